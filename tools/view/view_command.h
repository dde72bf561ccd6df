// `haustra view`: a running haustrad, or a finished run (`haustra view OUT`), in a browser of this machine.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; `action` is set when it was chosen and returns the exit code.
void AddViewCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
