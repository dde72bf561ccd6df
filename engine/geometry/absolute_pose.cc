#include "engine/geometry/absolute_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <limits>

#include "engine/geometry/p3p.h"
#include "engine/geometry/ransac_trials.h"

namespace haustra {
namespace {

constexpr int kPoseSampleSize = 3;
constexpr int kMinPoseMatches = 4;  // three define up to four poses, the fourth tells which
constexpr int kLocalPoseIterations = 4;
constexpr int kFinalPoseIterations = 8;

// Squared sine of the angle between a bearing and a point in camera coordinates; 1 (as far off as can be) behind it.
double SquaredSine(const Eigen::Vector3d& bearing, const Eigen::Vector3d& point_in_cam) {
  const double along = bearing.dot(point_in_cam);
  if (!(along > 0.0)) return 1.0;
  return bearing.cross(point_in_cam).squaredNorm() / point_in_cam.squaredNorm();
}

}  // namespace

AbsolutePoseRansac::AbsolutePoseRansac(int max_matches)
    : max_matches_(max_matches), inverse_tolerance2_(max_matches), inliers_(max_matches) {}

double AbsolutePoseRansac::Cost(const SE3& cam_from_world, double bound) const {
  const Eigen::Matrix3d rotation = cam_from_world.matrix3();
  double cost = 0.0;
  for (int i = 0; i < num_matches_ && cost < bound; ++i) {
    const Eigen::Vector3d point = rotation * points_in_world_[i] + cam_from_world.translation;
    cost += std::min(1.0, SquaredSine(bearings_[i], point) * inverse_tolerance2_[i]);
  }
  return cost;
}

void AbsolutePoseRansac::Refine(int iterations, SE3* cam_from_world) const {
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const Eigen::Matrix3d rotation = cam_from_world->matrix3();
    Matrix6d hessian = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    int used = 0;
    for (int i = 0; i < num_matches_; ++i) {
      const Eigen::Vector3d& bearing = bearings_[i];
      const Eigen::Vector3d point = rotation * points_in_world_[i] + cam_from_world->translation;
      if (SquaredSine(bearing, point) * inverse_tolerance2_[i] >= 1.0) continue;
      ++used;
      // Gnomonic residual about the bearing: r = (u . p, v . p) / (b . p), tangent of the angle along u and v.
      const Eigen::Vector3d u = bearing.unitOrthogonal();
      const Eigen::Vector3d axes[2] = {u, bearing.cross(u)};
      const double inverse_depth = 1.0 / bearing.dot(point);
      for (const Eigen::Vector3d& axis : axes) {
        const double residual = axis.dot(point) * inverse_depth;
        const Eigen::Vector3d by_point = (axis - residual * bearing) * inverse_depth;
        Vector6d jacobian;
        jacobian << by_point, point.cross(by_point);
        const Vector6d weighted = inverse_tolerance2_[i] * jacobian;
        hessian.noalias() += weighted * jacobian.transpose();
        gradient += residual * weighted;
      }
    }
    if (used < kMinPoseMatches) return;
    const Vector6d step = -hessian.ldlt().solve(gradient);
    if (!step.allFinite()) return;
    *cam_from_world = SE3::Exp(step) * *cam_from_world;
    // Expected decrease of a cost whose unit is one tolerance squared.
    if (-gradient.dot(step) < 1e-10 * used) return;
  }
}

bool AbsolutePoseRansac::Run(std::span<const Eigen::Vector3d> bearings,
                             std::span<const Eigen::Vector3d> points_in_world, std::span<const double> tolerance_rad,
                             const Options& options, Rng& rng, Estimate* estimate) {
  num_matches_ = 0;
  const int min_inliers = std::max(options.min_inliers, kMinPoseMatches);
  if (bearings.size() > static_cast<std::size_t>(max_matches_)) return false;
  num_matches_ = static_cast<int>(bearings.size());
  std::fill_n(inliers_.begin(), num_matches_, std::uint8_t{0});
  if (points_in_world.size() != bearings.size() || tolerance_rad.size() != bearings.size()) return false;
  if (num_matches_ < min_inliers) return false;
  bearings_ = bearings;
  points_in_world_ = points_in_world;
  for (int i = 0; i < num_matches_; ++i) inverse_tolerance2_[i] = 1.0 / (tolerance_rad[i] * tolerance_rad[i]);

  SE3 best;
  double best_cost = std::numeric_limits<double>::infinity();
  int needed = options.max_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    std::array<int, kPoseSampleSize> sample;
    rng.SampleDistinct(num_matches_, sample);
    const std::array<Eigen::Vector3d, 3> sample_bearings = {bearings[sample[0]], bearings[sample[1]],
                                                            bearings[sample[2]]};
    const std::array<Eigen::Vector3d, 3> sample_points = {points_in_world[sample[0]], points_in_world[sample[1]],
                                                          points_in_world[sample[2]]};
    std::array<SE3, 4> poses;
    const int num_poses = SolveP3P(sample_bearings, sample_points, &poses);
    for (int k = 0; k < num_poses; ++k) {
      double cost = Cost(poses[k], best_cost);
      if (!(cost < best_cost)) continue;
      SE3 refined = poses[k];
      Refine(kLocalPoseIterations, &refined);
      const double refined_cost = Cost(refined, cost);
      if (refined_cost < cost) {
        cost = refined_cost;
        poses[k] = refined;
      }
      best = poses[k];
      best_cost = cost;
      // The cost bounds the number of inliers from below: every match that costs less than one is one.
      const int at_least = num_matches_ - static_cast<int>(cost);
      needed = std::min(
          needed, RansacTrials(at_least, num_matches_, kPoseSampleSize, options.confidence, options.max_iterations));
    }
  }
  if (!(best_cost < num_matches_)) return false;

  SE3 refined = best;
  Refine(kFinalPoseIterations, &refined);
  if (Cost(refined, best_cost) < best_cost) best = refined;
  int num_inliers = 0;
  for (int i = 0; i < num_matches_; ++i) {
    inliers_[i] = SquaredSine(bearings[i], best * points_in_world[i]) * inverse_tolerance2_[i] < 1.0 ? 1 : 0;
    num_inliers += inliers_[i];
  }
  if (num_inliers < min_inliers) {
    std::fill_n(inliers_.begin(), num_matches_, std::uint8_t{0});
    return false;
  }
  estimate->cam_from_world = best;
  estimate->num_inliers = num_inliers;
  return true;
}

}  // namespace haustra
