// haustra soak: hours of video from one sequence, played over and over; fails when memory grows or latency drifts.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; `action` is set when it was chosen and returns the exit code.
void AddSoakCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
