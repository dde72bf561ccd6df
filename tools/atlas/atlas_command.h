// `haustra atlas info FILE`: what an atlas file holds, and whether it is whole.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; `action` is set when it was chosen and returns the exit code.
void AddAtlasCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
