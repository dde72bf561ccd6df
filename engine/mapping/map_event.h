// What happened to the maps, for the log and for the evaluation.
#pragma once

#include <cstdint>
#include <string_view>

#include "engine/atlas/handles.h"
#include "engine/place/common_area.h"
#include "engine/place/relocaliser.h"
#include "hal/core/time.h"

namespace haustra {

enum class MapEventKind : std::uint8_t {
  kMapCreated,
  kMapRefused,
  kMapDropped,
  kMapStored,
  kMerged,
  kLoopClosed,
  kMergeRejected,
  kFrameFound,     // a frame that tracking had lost, in the map named
  kFrameNotFound,  // a candidate for one that was turned down
  kMapEvicted,     // a stored map that had to make room
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
  CommonAreaCounts place;               // of a merge, a loop or a rejected candidate: what was measured
  RelocalisationCounts relocalisation;  // of a frame found, or of a candidate that was turned down
  Duration duration{0};                 // of a merge, a loop or the search for a frame, when the mapper has a clock
};

}  // namespace haustra
