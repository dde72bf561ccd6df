// Matches between two places of one map that lie where its poses say, but for a drift that bends the map: no similarity
// tells it. What does is that the offset, from where a point of b is projected to where the feature of a that looks
// like it was seen, changes slowly over the picture: it is that of the matches around it. Wrong matches have offsets of
// their own. The idea is the local consistency of non-rigid matching (Pizarro and Bartoli 2012, "Feature-based
// deformable surface detection with self-occlusion reasoning"), with a median in the place of a warp.
// reentrant; allocates; quadratic in the number of matches.
#pragma once

#include <cstdint>
#include <span>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/geometry/sim3_match.h"

namespace haustra {

struct SmoothOffsetsOptions {
  double max_offset_px = 0.0;  // in either view; > 0
  double max_roughness = 0.0;  // distance to the median of the neighbours' offsets, over sigma_a_px; > 0
  int neighbours = 9;          // nearest ones in the view of a
  int min_neighbours = 5;      // with fewer nothing is kept
};

struct SmoothOffsets {
  int num_near = 0;  // matches whose offsets are not too large
  int num_kept = 0;  // of these, that agree with those around them
};

// views_a[k] = cam_from_map, views_b[k] = cam_from_map, of one map; every match names one of each. `kept` has one entry
// a match, written 1 or 0.
SmoothOffsets KeepSmoothOffsets(const CameraModel& camera, std::span<const Sim3Match> matches,
                                std::span<const SE3> views_a, std::span<const SE3> views_b,
                                const SmoothOffsetsOptions& options, std::span<std::uint8_t> kept);

}  // namespace haustra
