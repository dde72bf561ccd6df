// Cells at a jump of the depth. The edge of a fold passes through them or close by: what range they have is a matter of
// a pixel, and no picture of a window wider than that tells. Unknown is the honest answer there.
// Source: the usual discard of depths at discontinuities before fusion, with a limit that is an angle. reentrant.
#pragma once

#include "engine/camera/camera_model.h"
#include "engine/surface/depth_map.h"

namespace haustra {

// Erases both of two neighbouring cells, beside, below or across, if a wall through their ranges would be seen at less
// than `min_slant_deg` in the farther one, (0, 90). A gap between two cells is no jump. `camera`: whose grid has
// step_px pixels a cell. Returns how many were erased. O(cells). Allocates: not rt-safe.
int EraseJumps(const CameraModel& camera, int step_px, double min_slant_deg, DepthMap* map);

}  // namespace haustra
