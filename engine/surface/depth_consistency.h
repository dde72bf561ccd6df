// Depths of several keyframes held against each other: what one of them claims, another must see there too.
// Source: Schonberger et al. 2016, "Pixelwise view selection", section 4.4 (forward-backward check), in its simplest
// form; Merrell et al. 2007 (fusion of depth by what agrees). reentrant, rt-safe.
#pragma once

#include <Eigen/Core>
#include <span>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/surface/depth_map.h"

namespace haustra {

struct ConsistencyOptions {
  // Relative difference of range up to which two depths agree, > 0. A rigid wall is off by the noise of both depths; a
  // breathing one by its motion between the keyframes, which is several per cent.
  double tolerance = 0.04;
  // So many other keyframes must agree, >= 0.
  int min_agreeing = 1;
  // Less confident depths have no say and no place, 0 to 255.
  int min_confidence = 1;
};

// Not owning. Depth and pose belong to one keyframe.
struct PosedDepth {
  const DepthMap* depth = nullptr;
  SE3 cam_from_map;
};

// Fills `checked`, of the size of reference.depth, with the cells of it that min_agreeing of `others` agree with. Their
// inverse range is the mean of those that agree, weighted by confidence. `camera`: whose grid has step_px pixels a
// cell. `checked` is none of the inputs. Returns how many cells have a depth. O(cells * others).
int CheckDepth(const CameraModel& camera, int step_px, const PosedDepth& reference, std::span<const PosedDepth> others,
               const ConsistencyOptions& options, DepthMap* checked);

}  // namespace haustra
