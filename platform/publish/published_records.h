// What the engine says, in the words of the shared-memory file (haustra_pose_ring.h).
#pragma once

#include <cstdint>
#include <vector>

#include "engine/engine.h"
#include "platform/publish/haustra_pose_ring.h"

namespace haustra {

// rt-safe. `captured` and `now`: CLOCK_MONOTONIC. `marks` as of the same frame.
haustra_pose PoseRecord(const FrameResult& result, const MarkSightings& marks, TimePoint captured, TimePoint now,
                        std::uint64_t procedure);

haustra_event EventRecord(const MapEvent& event, TimePoint now, std::uint64_t procedure);

// All marks, and the active map; empty but for the marks, with HAUSTRA_NO_MAP, when there is none. Every n-th point of
// a map that has more than there is room for, and of the keyframes likewise. Mapping thread. `points` is workspace.
void FillSnapshot(const Engine& engine, TimePoint now, std::uint64_t procedure, std::vector<haustra_point>* points,
                  haustra_snapshot* snapshot);

}  // namespace haustra
