// Cells at a jump of the depth. The edge of a fold passes through them or close by: what range they have is a matter of
// a pixel, and no window wider than that can tell. Unknown is the honest answer there. Source: Turk and Levoy 1994,
// "Zippered polygon meshes from range images", leave out what spans a step in depth; that the limit is an angle is
// ours. reentrant.
#pragma once

#include "engine/camera/camera_model.h"
#include "engine/surface/depth_consistency.h"
#include "engine/surface/depth_map.h"
#include "hal/depth_search.h"

namespace haustra {

struct JumpOptions {
  // A wall that a ray meets at less than this is not seen, degrees, (0, 90): the matcher's own limit.
  double min_slant_deg = depth_search::kMinSlantDeg;
  // Ranges that differ by less than this share are one wall, >= 0: each may be off by the tolerance of agreement. On a
  // fine grid a noisy wall is steeper from cell to cell than any slant.
  double one_wall = 2.0 * ConsistencyOptions().tolerance;
};

// A jump lies between two neighbouring cells, beside, below or across, if their ranges are not of one wall and a wall
// through both would be seen at less than min_slant_deg in the farther one. First cells are erased that jump against
// most of their neighbours: they alone are wrong. Then both sides of each jump that is left. A gap between two cells is
// no jump. `camera`: whose grid has step_px pixels a cell. Returns how many were erased. O(cells). Allocates: not
// rt-safe.
int EraseJumps(const CameraModel& camera, int step_px, const JumpOptions& options, DepthMap* map);

}  // namespace haustra
