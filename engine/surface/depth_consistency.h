// Depths of several keyframes held against each other: what one of them claims, another must see there too, and none
// may see through it. What a keyframe does not know is taken from others.
// Source: Schonberger et al. 2016, "Pixelwise view selection", section 4.4 (forward-backward check), in its simplest
// form; Merrell et al. 2007 (fusion of depth by what agrees, and by what is seen through). reentrant.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/surface/depth_map.h"

namespace haustra {

struct ConsistencyOptions {
  // Relative difference of range up to which two depths agree, > 0. A rigid wall is off by the noise of both depths; a
  // breathing one by its motion between the keyframes, which is several per cent.
  double tolerance = 0.04;
  // A keyframe whose wall is farther than the claimed one by more than this share sees through it, > tolerance.
  double seen_through = 0.06;
  // So many other keyframes must agree, all of them where there are fewer, >= 0; without any no depth stands, but for
  // 0. Only what is checked, not what is filled in, asks for it. One of sixteen agrees with a false depth too easily,
  // where the wall has little texture.
  int min_agreeing = 2;
  // So many may see through it for each that agrees, the claiming one among them, >= 0. Windows at the edge of a fold
  // see its texture and claim its range beside it: most of what is wrong in a depth is such a strip, and it is nearer
  // than the wall. Other keyframes look past the edge.
  double max_seeing_through = 0.3;
  // Less confident depths have no say and no place, 0 to 255.
  int min_confidence = 1;
};

// Not owning. Depth and pose belong to one keyframe.
struct PosedDepth {
  const DepthMap* depth = nullptr;
  SE3 cam_from_map;
};

// Fills `checked`, of the size of reference.depth, with the cells of it that stand against `others`. Their inverse
// range is the mean of those that agree, weighted by confidence. `camera`: whose grid has step_px pixels a cell.
// `checked` is none of the inputs. Returns how many cells have a depth. O(cells * others). rt-safe.
int CheckDepth(const CameraModel& camera, int step_px, const PosedDepth& reference, std::span<const PosedDepth> others,
               const ConsistencyOptions& options, DepthMap* checked);

// Fills `filled` with reference.depth and, in cells without one, with the nearest wall that one of `others` has there
// and that not too many see through. All of them are checked before. `shows_scene`: not 0 in cells that may be filled,
// num_cells() of them. Sizes, camera and return as of CheckDepth. Allocates: not rt-safe.
int FillDepth(const CameraModel& camera, int step_px, const PosedDepth& reference, std::span<const PosedDepth> others,
              std::span<const std::uint8_t> shows_scene, const ConsistencyOptions& options, DepthMap* filled);

}  // namespace haustra
