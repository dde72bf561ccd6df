// What happened to the maps, for the log and for the evaluation.
#pragma once

#include <cstdint>
#include <string_view>

#include "engine/atlas/handles.h"
#include "engine/place/common_area.h"
#include "hal/core/time.h"

namespace haustra {

enum class MapEventKind : std::uint8_t {
  kMapCreated,
  kMapRefused,
  kMapDropped,
  kMapStored,
  kMerged,
  kLoopClosed,
  kMergeRejected
};

std::string_view ToString(MapEventKind kind);

struct MapEvent {
  MapEventKind kind = MapEventKind::kMapCreated;
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  MapId map_id = kNoId;
  MapId other_map_id = kNoId;
  int num_keyframes = 0;
  int num_points = 0;
  CommonAreaCounts place;  // of a merge, a loop or a rejected candidate: what was measured
  Duration duration{0};    // of a merge or a loop, when the mapper has a clock
};

}  // namespace haustra
