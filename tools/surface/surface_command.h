// `haustra surface RUN --sequence SEQUENCE --out FOLDER`: the wall of each map as a triangle mesh.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; sets `action` when it was chosen.
void AddSurfaceCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
