#include "engine/geometry/rotation_fit.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace haustra {
namespace {

constexpr int kRounds = 4;
// Residual at which a pair counts half (rad): far points hold the rotation, near ones may move.
constexpr double kSoftness = 0.01;

}  // namespace

bool FitRotation(std::span<const Eigen::Vector3d> bearings_a, std::span<const Eigen::Vector3d> bearings_b,
                 std::span<const std::uint8_t> flags, Eigen::Matrix3d* b_from_a, std::span<double> residual_rad) {
  const std::size_t num = bearings_a.size();
  if (bearings_b.size() != num || flags.size() != num || residual_rad.size() != num) return false;
  if (std::count_if(flags.begin(), flags.end(), [](std::uint8_t f) { return f != 0; }) < 3) return false;
  std::fill(residual_rad.begin(), residual_rad.end(), 0.0);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < num; ++i) {
      if (flags[i] == 0) continue;
      const double ratio = residual_rad[i] / kSoftness;
      sum += bearings_b[i] * bearings_a[i].transpose() / (1.0 + ratio * ratio);
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
    sign(2, 2) = svd.matrixU().determinant() * svd.matrixV().determinant() < 0 ? -1.0 : 1.0;
    *b_from_a = svd.matrixU() * sign * svd.matrixV().transpose();
    for (std::size_t i = 0; i < num; ++i) {
      const Eigen::Vector3d turned = *b_from_a * bearings_a[i];
      residual_rad[i] = std::atan2(turned.cross(bearings_b[i]).norm(), turned.dot(bearings_b[i]));
    }
  }
  return true;
}

}  // namespace haustra
