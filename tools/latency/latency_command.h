// haustra latency: plays a sequence in real time, measures every stage of every frame, and says whether a requirement
// is met.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace haustra {

void AddLatencyCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
