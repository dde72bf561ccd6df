#include "engine/mapping/map_event.h"

namespace haustra {

std::string_view ToString(MapEventKind kind) {
  switch (kind) {
    case MapEventKind::kMapCreated: return "map_created";
    case MapEventKind::kMapRefused: return "map_refused";
    case MapEventKind::kMapDropped: return "map_dropped";
    case MapEventKind::kMapStored: return "map_stored";
    case MapEventKind::kMapEvicted: return "map_evicted";
    case MapEventKind::kMerged: return "merged";
    case MapEventKind::kLoopClosed: return "loop_closed";
    case MapEventKind::kMergeRejected: return "merge_rejected";
    case MapEventKind::kFrameFound: return "frame_found";
    case MapEventKind::kFrameNotFound: return "frame_not_found";
  }
  return "unknown";
}

}  // namespace haustra
