// `haustra watch`: what a running haustrad sees, live, from its shared memory and its control socket.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; sets `action` when it was chosen.
void AddWatchCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
