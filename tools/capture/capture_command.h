// `haustra capture`: the cameras of this machine, and recordings of them for replay.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; `action` is set when it was chosen and returns the exit code.
void AddCaptureCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
