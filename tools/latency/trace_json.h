// What ran when, as Chrome's trace format (open it in ui.perfetto.dev or chrome://tracing): capture, tracking with its
// stages, mapping with its stages, merging, one row each; a mark at each deadline. Within a frame the stages stand in
// the order in which they run, one after the other: what lies between them is shown at the end. reentrant.
#pragma once

#include <string>

#include "tools/latency/latency_record.h"

namespace haustra {

std::string MakeTraceJson(const LatencyRecord& record);

}  // namespace haustra
