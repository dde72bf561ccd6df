// The wall of a map as the depths of its keyframes say, for its coverage. The mesh has less of it: its volume leaves
// out what few keyframes see, and that is where a wall is missed.
#pragma once

#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/coverage/wall_grid.h"
#include "tools/surface/map_surface.h"

namespace haustra::surface {

// A depth that other keyframes look through by more than this share of its range contradicts them; one within the
// tolerance of ConsistencyOptions agrees. What is contradicted by more than so many for each that agrees (itself among
// them) is left out: strips of false depth behind the edges of folds, which the next keyframe sees through. Chosen on
// one rendered colon (tools/benchmarks/results).
inline constexpr double kSeenThrough = 0.06;
inline constexpr double kMaxContradictions = 0.3;

// camera: of the map. step_px: pixels from one cell of a depth to the next. Patches by keyframe, then by cell; the
// result does not depend on num_threads. O(depths * keyframes within reach).
std::vector<WallPatch> PatchesOf(const std::vector<KeyframeDepth>& depths, const CameraModel& camera, int step_px,
                                 int num_threads);

}  // namespace haustra::surface
