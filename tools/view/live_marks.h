// The marks of a running engine, as JSON for a page: what they are, and how a frame sees them. They belong together by
// their id. reentrant.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>

#include "platform/publish/haustra_pose_ring.h"

namespace haustra::view {

// Marks of all maps: id, label, map, position.
nlohmann::ordered_json MarksJson(const haustra_snapshot& snapshot);

// As the frame of a pose sees them, those out of view among them: id, state, distance (in depths of the scene).
nlohmann::ordered_json SightingsJson(const haustra_pose& pose);

// Those that may be drawn into a picture of the frame which holds every step-th pixel: id, state (in_front, unsure), x
// and y in pixels of the picture. Hidden ones are not told.
nlohmann::ordered_json DrawnMarksJson(const haustra_pose& pose, std::uint32_t step);

// The pose of a frame, as long as the ring holds it. Looks back from the newest one.
bool FindPose(const haustra_ring& ring, std::uint64_t frame_index, std::uint64_t procedure, haustra_pose* pose);

}  // namespace haustra::view
