// Essential matrices from five matched bearings (Nister 2004, "An efficient solution to the five-point relative pose
// problem"): the ten cubic constraints on a four-dimensional null space, reduced to one polynomial of degree ten.
// reentrant, rt-safe, about 20 us.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

namespace haustra {

// bearing_b' * essential * bearing_a = 0 for all five; |essential| = 1 (Frobenius). Writes up to ten, returns how many.
// None when the five pairs do not determine the null space (repeated points, all on one epipolar plane).
int SolveFivePoint(std::span<const Eigen::Vector3d, 5> bearings_a, std::span<const Eigen::Vector3d, 5> bearings_b,
                   std::array<Eigen::Matrix3d, 10>* essentials);

}  // namespace haustra
