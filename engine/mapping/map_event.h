// What happened to the maps, for the log and for the evaluation.
#pragma once

#include <cstdint>
#include <string_view>

#include "engine/atlas/handles.h"
#include "hal/core/time.h"

namespace haustra {

enum class MapEventKind : std::uint8_t { kMapCreated, kMapRefused, kMapDropped, kMapStored, kMerged, kLoopClosed };

std::string_view ToString(MapEventKind kind);

struct MapEvent {
  MapEventKind kind = MapEventKind::kMapCreated;
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  MapId map_id = kNoId;
  MapId other_map_id = kNoId;
  int num_keyframes = 0;
  int num_points = 0;
};

}  // namespace haustra
