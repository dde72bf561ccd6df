// A map was moved, changed its unit or went up in another one. Plain data.
#pragma once

#include "engine/atlas/handles.h"
#include "engine/geometry/sim3.h"

namespace haustra {

// Poses held in `old_map_id` become TransformPose(pose, new_from_old) in `new_map_id`; the two may be one map.
struct Reframing {
  MapId old_map_id = kNoId;
  MapId new_map_id = kNoId;
  Sim3 new_from_old;
  // False: only where the newest keyframe stands it holds. What is known of earlier frames is of another shape.
  bool keeps_shape = true;

  // Takes a pose along; false, with nothing touched, when it is not in the map that was moved.
  bool Carry(MapId* map_id, SE3* cam_from_map) const {
    if (*map_id != old_map_id) return false;
    *map_id = new_map_id;
    *cam_from_map = TransformPose(*cam_from_map, new_from_old);
    return true;
  }
};

}  // namespace haustra
