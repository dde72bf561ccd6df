// What the mapper tells the tracker: that a proposal was answered, or that a map was moved. Small messages that go
// through a ring which loses none (tracking_link.h), in the order in which things happened. What the map looks like now
// stands in the snapshot (engine/atlas/local_map.h) and nowhere else. Plain data.
#pragma once

#include <cstdint>
#include <variant>

#include "engine/atlas/handles.h"
#include "engine/atlas/reframing.h"
#include "engine/geometry/se3.h"

namespace haustra {

// The proposal founded a map, which is the active one; the pose is that of its second view.
struct MapFounded {
  std::uint64_t proposal = 0;
  MapId map_id = kNoId;
  SE3 cam_from_map;
};

// The proposal founds no map.
struct MapRefused {
  std::uint64_t proposal = 0;
};

// The frame whose place was asked for shows a stored map, which has been made the active one.
struct FrameFound {
  std::uint32_t frame_index = 0;
  MapId map_id = kNoId;
  SE3 cam_from_map;
};

// No map shows the frame whose place was asked for.
struct FrameNotFound {};

using MapReply = std::variant<MapFounded, MapRefused, FrameFound, FrameNotFound, Reframing>;

struct VersionedReply {
  // Of the first snapshot that knows of it. The reply waits in the ring until the tracker has this one or a later one:
  // poses, points and replies are always of the same time.
  std::uint64_t version = 0;
  MapReply reply;
};

}  // namespace haustra
