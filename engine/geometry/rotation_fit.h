// The rotation that alone explains matched bearings best, and what it leaves: how far two views really are from each
// other. A small translation and a small rotation look alike over a narrow field; parallax measured with an estimated
// translation flatters itself, what no rotation can explain does not. reentrant, rt-safe.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

namespace haustra {

// Robust fit (Wahba's problem by SVD, reweighted a few times) over the pairs with a non-zero flag. Writes the angle
// between R * a and b for every pair, rad. False with fewer than 3 flagged pairs or spans of different length.
bool FitRotation(std::span<const Eigen::Vector3d> bearings_a, std::span<const Eigen::Vector3d> bearings_b,
                 std::span<const std::uint8_t> flags, Eigen::Matrix3d* b_from_a, std::span<double> residual_rad);

}  // namespace haustra
