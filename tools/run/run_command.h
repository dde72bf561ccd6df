// `haustra run`: maps a sequence and writes everything about it.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; sets `action` when it was chosen.
void AddRunCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
