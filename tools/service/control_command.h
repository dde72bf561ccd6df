// `haustra control`: one request to a running haustrad.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; sets `action` when it was chosen.
void AddControlCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
