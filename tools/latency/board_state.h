// Clocks, power mode and temperatures of the board, as far as it says: cpufreq, devfreq and thermal zones of sysfs, and
// the power mode of NVIDIA's nvpmodel. What is not there is left out. reentrant.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace haustra {

using BoardState = std::vector<std::pair<std::string, std::string>>;  // what, value

// root: "" on a board; a folder that stands for it in tests.
BoardState ReadBoardState(const std::string& root);

}  // namespace haustra
