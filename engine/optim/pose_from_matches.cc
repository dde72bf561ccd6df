#include "engine/optim/pose_from_matches.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"

namespace haustra {

PoseFromMatches::PoseFromMatches(const CameraModel& camera, int max_matches) : camera_(camera), ransac_(max_matches) {
  const auto num = static_cast<std::size_t>(max_matches);
  // Filled once, so that the first frame does not pay for the pages.
  observations_.assign(num, {Eigen::Vector3d::Zero(), Eigen::Vector2d::Zero(), 1.0});
  points_.assign(num, Eigen::Vector3d::Zero());
  tolerance_.assign(num, 0.0);
  inliers_.assign(num, 0);
  observations_.clear();
}

bool PoseFromMatches::Sample(std::span<const Eigen::Vector3d> bearings, const AbsolutePoseRansac::Options& options,
                             Rng& rng, AbsolutePoseRansac::Estimate* estimate) {
  points_.clear();
  tolerance_.clear();
  const double gate = std::sqrt(kChi2TwoDof);
  for (const PoseObservation& match : observations_) {
    points_.push_back(match.point_in_world);
    tolerance_.push_back(gate * match.sigma_px / camera_.focal_px());
  }
  const bool is_found = ransac_.Run(bearings, points_, tolerance_, options, rng, estimate);
  inliers_.assign(observations_.size(), 0);
  if (is_found) std::copy_n(ransac_.inliers().begin(), observations_.size(), inliers_.begin());
  return is_found;
}

bool PoseFromMatches::Fit(const SE3& guess, int min_inliers, PoseOptimizerResult* result) {
  PoseOptimizerOptions options;
  options.chi2_gate = kChi2TwoDof;
  inliers_.resize(observations_.size());
  PoseOptimizerResult fitted;
  if (!OptimizePose(camera_, observations_, guess, options, inliers_, &fitted)) {
    std::fill(inliers_.begin(), inliers_.end(), std::uint8_t{0});
    return false;
  }
  *result = fitted;
  return fitted.num_inliers >= min_inliers;
}

}  // namespace haustra
