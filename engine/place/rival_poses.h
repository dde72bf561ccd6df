// When two verified places of one map contradict each other: then the wall looks alike at both, and neither is known.
// Lengths in units of that map. reentrant.
#pragma once

#include <cmath>

#include "engine/geometry/se3.h"
#include "engine/geometry/sim3.h"

namespace haustra {

// The pose of one camera by the one and by the other place. `agreement` is a displacement of what the camera sees at
// the median depth, over that depth: by its position, and, in radians, by its orientation.
inline bool AreRivals(const SE3& cam_from_map, const SE3& rival_cam_from_map, double median_depth, double agreement) {
  const double apart = (cam_from_map.InverseTranslation() - rival_cam_from_map.InverseTranslation()).norm();
  return apart > agreement * median_depth ||
         RotationAngle(cam_from_map.rotation, rival_cam_from_map.rotation) > agreement;
}

// The same of a camera of map a, by two similarities into map b (the one with the median depth); and by what they make
// of its unit.
inline bool AreRivals(const SE3& cam_from_a, const Sim3& b_from_a, const Sim3& rival_b_from_a, double median_depth,
                      double agreement) {
  return AreRivals(TransformPose(cam_from_a, b_from_a), TransformPose(cam_from_a, rival_b_from_a), median_depth,
                   agreement) ||
         std::abs(std::log(b_from_a.scale / rival_b_from_a.scale)) > agreement;
}

}  // namespace haustra
