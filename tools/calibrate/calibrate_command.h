// `haustra calibrate`: a calibration from the clip itself.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// In the files that it writes, and in no others.
inline constexpr const char* kEstimateRemark = "Estimated by haustra calibrate";

void AddCalibrateCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
