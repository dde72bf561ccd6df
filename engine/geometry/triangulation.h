// Two-view triangulation of unit bearings. Works for any field of view: nothing is divided by z. reentrant, rt-safe,
// about 0.1 us.
#pragma once

#include <Eigen/Core>

#include "engine/geometry/se3.h"

namespace haustra {

struct Triangulated {
  Eigen::Vector3d point_in_a;  // in the unit of b_from_a's translation
  double cos_parallax;         // of the angle between the two (corrected) rays
};

// The point whose rays are nearest to both bearings: both are turned onto one epipolar plane by the smallest sum of
// squared sines, in closed form (Oliensis 2002; Lee and Civera 2019, "Closed-form optimal two-view triangulation based
// on angular errors"), and then meet exactly. False, and `out` untouched, when the point lies behind either camera
// (negative depth along the bearing), when the rays are parallel to within 1e-5 rad, or when the baseline is zero. It
// does not judge how far the bearings had to be turned: check the epipolar or the reprojection error for that.
bool TriangulateBearings(const SE3& b_from_a, const Eigen::Vector3d& bearing_a, const Eigen::Vector3d& bearing_b,
                         Triangulated* out);

}  // namespace haustra
