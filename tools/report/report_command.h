// `haustra report OUT --html FILE`: a run as one page.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; `action` is set when it was chosen and returns the exit code.
void AddReportCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
