// `haustra export RUN --format FORMAT --out FOLDER`: the maps of a run for other programs.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; sets `action` when it was chosen.
void AddExportCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
