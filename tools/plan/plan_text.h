// A memory plan for people and for programs.
#pragma once

#include <string>

#include "hal/core/memory_plan.h"

namespace haustra {

// A table with a line a pool and the totals; `heading` names what was planned.
std::string PlanText(const std::string& heading, const MemoryPlan& plan);

// {"lines": [{"pool", "count", "bytes", "place", "sized_by"}], "host_arena_bytes", "host_pinned_bytes", "host_bytes",
// "device_bytes"}.
std::string PlanJson(const MemoryPlan& plan);

}  // namespace haustra
