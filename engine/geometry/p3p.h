// Camera poses from three bearings and three points: the distances along the bearings are where two conics meet, found
// by factoring the degenerate member of their pencil (Persson and Nordberg 2018, "Lambda Twist: an accurate fast robust
// perspective three point solver"). reentrant, rt-safe, about 1 us.
#pragma once

#include <array>
#include <span>

#include "engine/geometry/se3.h"

namespace haustra {

// Writes up to four poses with all points in front along their bearings; returns how many. None when the points lie on
// one line, coincide, or no such pose exists.
int SolveP3P(std::span<const Eigen::Vector3d, 3> bearings, std::span<const Eigen::Vector3d, 3> points_in_world,
             std::array<SE3, 4>* cam_from_world);

}  // namespace haustra
