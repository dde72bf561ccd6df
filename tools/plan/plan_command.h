// haustra plan: what a configuration takes in memory, pool by pool, before anything is started.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

void AddPlanCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
