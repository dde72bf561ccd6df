#include "engine/geometry/sim3.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <cmath>

namespace haustra {
namespace {

// Second largest share of the spread below which points count as lying on one line.
constexpr double kMinRelativeSpread = 1e-8;

// Whether a 3x3 scatter matrix has spread in at least two directions.
bool SpansPlane(const Eigen::Matrix3d& scatter) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.compute(scatter, Eigen::EigenvaluesOnly);
  const Eigen::Vector3d values = solver.eigenvalues();  // ascending
  return std::isfinite(values[2]) && values[2] > 0.0 && values[1] > kMinRelativeSpread * values[2];
}

}  // namespace

bool AlignSim3(std::span<const Eigen::Vector3d> points_in_a, std::span<const Eigen::Vector3d> points_in_b,
               Sim3* b_from_a) {
  const std::size_t count = points_in_a.size();
  if (count < 3 || points_in_b.size() != count) return false;

  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    mean_a += points_in_a[i];
    mean_b += points_in_b[i];
  }
  mean_a /= static_cast<double>(count);
  mean_b /= static_cast<double>(count);

  Eigen::Matrix3d scatter_a = Eigen::Matrix3d::Zero(), scatter_b = scatter_a, cross = scatter_a;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d a = points_in_a[i] - mean_a, b = points_in_b[i] - mean_b;
    scatter_a += a * a.transpose();
    scatter_b += b * b.transpose();
    cross += b * a.transpose();
  }
  if (!SpansPlane(scatter_a) || !SpansPlane(scatter_b)) return false;

  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d singular = svd.singularValues();
  if (!(singular[1] > kMinRelativeSpread * singular[0])) return false;
  // A reflection would fit better when the determinant is negative: turn the weakest axis (Umeyama 1991, eq. 39 to 43).
  Eigen::Vector3d sign(1.0, 1.0, svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0);
  const Eigen::Matrix3d rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  const double scale = singular.dot(sign) / scatter_a.trace();
  if (!(scale > 0.0) || !std::isfinite(scale)) return false;
  *b_from_a = Sim3(scale, Eigen::Quaterniond(rotation), mean_b - scale * (rotation * mean_a));
  return true;
}

}  // namespace haustra
