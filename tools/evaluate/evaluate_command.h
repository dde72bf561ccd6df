// `haustra evaluate OUT... --groundtruth FILE`: compares runs with the ground truth.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; `action` is set when it was chosen and returns the exit code.
void AddEvaluateCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
