// When two verified places of one map contradict each other: then the wall looks alike at both, and neither is known.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "engine/geometry/se3.h"
#include "engine/geometry/sim3.h"

namespace haustra {

// `agreement` is a displacement of what the camera sees at the median depth, over that depth: by the camera's position,
// and, in radians, by its orientation.
inline bool AreRivals(const SE3& a_from_map, const SE3& b_from_map, double median_depth, double agreement) {
  const double apart = (a_from_map.InverseTranslation() - b_from_map.InverseTranslation()).norm();
  return apart > agreement * median_depth || RotationAngle(a_from_map.rotation, b_from_map.rotation) > agreement;
}

// Of one camera in another map, by two similarities; and by what they make of its unit.
inline bool AreRivals(const SE3& cam_from_map, const Sim3& a_from_map, const Sim3& b_from_map, double median_depth,
                      double agreement) {
  return AreRivals(TransformPose(cam_from_map, a_from_map), TransformPose(cam_from_map, b_from_map), median_depth,
                   agreement) ||
         std::abs(std::log(a_from_map.scale / b_from_map.scale)) > agreement;
}

}  // namespace haustra
