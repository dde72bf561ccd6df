// `haustra calibrate`: a calibration from the clip itself.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

void AddCalibrateCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
