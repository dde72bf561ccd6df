// A pair of map points, one of each of two maps (or of two places of one map), that are believed to be the same point
// of the wall, each with a keyframe that saw it. Input of the Sim(3) estimators.
#pragma once

#include <Eigen/Core>

namespace haustra {

struct Sim3Match {
  Eigen::Vector3d point_in_a;  // map units of map a
  Eigen::Vector3d point_in_b;  // map units of map b
  Eigen::Vector2d pixel_in_a;  // where point_in_a was seen, in view `view_a`
  Eigen::Vector2d pixel_in_b;
  double sigma_a_px;  // > 0, of each coordinate
  double sigma_b_px;
  int view_a = 0;  // index of the observing camera's pose in `views_a` (cam_from_a) of the call
  int view_b = 0;
};

}  // namespace haustra
