// `haustra bench`: measures parts of the system on this machine.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; sets `action` when it was chosen.
void AddBenchCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
