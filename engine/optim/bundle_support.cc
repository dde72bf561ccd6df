#include "engine/optim/bundle_support.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace haustra::optim {
namespace {

std::string At(const char* what, std::size_t idx) { return std::string(what) + "[" + std::to_string(idx) + "]"; }

// From camera to point, of every observation.
void MeasureDistances(const BundleProblem& problem, std::vector<double>* distances) {
  distances->clear();
  distances->reserve(problem.observations.size());
  for (const BundleObservation& observation : problem.observations) {
    distances->push_back(
        (problem.poses[observation.pose_idx].cam_from_world * problem.points[observation.point_idx].position).norm());
  }
}

}  // namespace

Status ValidateBundle(const BundleOptions& options, const BundleProblem& problem) {
  if (options.max_iterations < 1) {
    return InvalidArgument("BundleOptions.max_iterations is " + std::to_string(options.max_iterations) +
                           ", must be at least 1");
  }
  if (!(options.chi2_gate > 0) || !std::isfinite(options.chi2_gate)) {
    return InvalidArgument("BundleOptions.chi2_gate is " + std::to_string(options.chi2_gate) + ", must be positive");
  }
  if (options.deadline != kNoDeadline && options.clock == nullptr) {
    return InvalidArgument("BundleOptions.deadline is set without a clock");
  }
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    const SE3& pose = problem.poses[i].cam_from_world;
    if (!pose.rotation.coeffs().allFinite() || !pose.translation.allFinite()) {
      return InvalidArgument(At("poses", i) + " is not finite");
    }
  }
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    if (!problem.points[i].position.allFinite()) return InvalidArgument(At("points", i) + " is not finite");
  }
  const auto num_poses = static_cast<std::int64_t>(problem.poses.size());
  const auto num_points = static_cast<std::int64_t>(problem.points.size());
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleObservation& observation = problem.observations[i];
    if (observation.pose_idx < 0 || observation.pose_idx >= num_poses) {
      return InvalidArgument(At("observations", i) + ".pose_idx is " + std::to_string(observation.pose_idx) +
                             ", there are " + std::to_string(num_poses) + " poses");
    }
    if (observation.point_idx < 0 || observation.point_idx >= num_points) {
      return InvalidArgument(At("observations", i) + ".point_idx is " + std::to_string(observation.point_idx) +
                             ", there are " + std::to_string(num_points) + " points");
    }
    if (!observation.pixel.allFinite()) return InvalidArgument(At("observations", i) + ".pixel is not finite");
    if (!(observation.sigma_px > 0) || !std::isfinite(observation.sigma_px)) {
      return InvalidArgument(At("observations", i) + ".sigma_px is " + std::to_string(observation.sigma_px) +
                             ", must be positive");
    }
  }
  return Status::Ok();
}

void GroupByPoint(const BundleProblem& problem, ObservationsByPoint* grouped) {
  // A counting sort: stable, so the order of the input decides within a point.
  grouped->begin.assign(problem.points.size() + 1, 0);
  for (const BundleObservation& observation : problem.observations) ++grouped->begin[observation.point_idx + 1];
  for (std::size_t i = 1; i < grouped->begin.size(); ++i) grouped->begin[i] += grouped->begin[i - 1];
  grouped->order.resize(problem.observations.size());
  std::vector<std::int32_t> next(grouped->begin.begin(), grouped->begin.end() - 1);
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    grouped->order[next[problem.observations[i].point_idx]++] = static_cast<std::int32_t>(i);
  }
}

BundleGauge ChooseGauge(const BundleProblem& problem) {
  std::vector<bool> pose_is_observed(problem.poses.size(), false);
  bool fixed_point_is_observed = false;
  bool free_point_is_observed = false;
  for (const BundleObservation& observation : problem.observations) {
    pose_is_observed[observation.pose_idx] = true;
    (problem.points[observation.point_idx].is_fixed ? fixed_point_is_observed : free_point_is_observed) = true;
  }
  BundleGauge gauge;
  int num_held = 0;
  int num_free = 0;
  std::int32_t first_held = -1;
  std::int32_t first_observed = -1;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(problem.poses.size()); ++i) {
    if (!pose_is_observed[i]) continue;
    if (first_observed < 0) first_observed = i;
    if (problem.poses[i].is_fixed) {
      ++num_held;
      if (first_held < 0) first_held = i;
    } else {
      ++num_free;
    }
  }
  // Fixed points hold the frame too; otherwise some pose has to.
  if (num_held == 0 && !fixed_point_is_observed && first_observed >= 0) {
    gauge.held_pose = first_observed;
    first_held = first_observed;
    num_held = 1;
    --num_free;
  }
  gauge.has_free_parameter = num_free > 0 || free_point_is_observed;
  if (num_held == 1 && !fixed_point_is_observed && num_free > 0) {
    gauge.anchor_pose = first_held;
    MeasureDistances(problem, &gauge.distances);
  }
  return gauge;
}

void RestoreScale(const BundleGauge& gauge, BundleProblem* problem) {
  if (gauge.anchor_pose < 0) return;
  std::vector<double> shrinks;
  MeasureDistances(*problem, &shrinks);
  std::size_t num = 0;
  for (std::size_t i = 0; i < shrinks.size(); ++i) {
    const double shrink = gauge.distances[i] / shrinks[i];
    if (std::isfinite(shrink) && shrink > 0.0) shrinks[num++] = shrink;
  }
  if (num == 0) return;
  const auto middle = shrinks.begin() + static_cast<std::ptrdiff_t>(num / 2);
  std::nth_element(shrinks.begin(), middle, shrinks.begin() + static_cast<std::ptrdiff_t>(num));
  const double scale = *middle;
  const Eigen::Vector3d anchor = problem->poses[gauge.anchor_pose].cam_from_world.InverseTranslation();
  std::vector<bool> pose_is_observed(problem->poses.size(), false);
  std::vector<bool> point_is_observed(problem->points.size(), false);
  for (const BundleObservation& observation : problem->observations) {
    pose_is_observed[observation.pose_idx] = true;
    point_is_observed[observation.point_idx] = true;
  }
  for (std::size_t i = 0; i < problem->poses.size(); ++i) {
    if (!pose_is_observed[i] || static_cast<std::int32_t>(i) == gauge.anchor_pose) continue;
    SE3& pose = problem->poses[i].cam_from_world;
    const Eigen::Vector3d centre = anchor + scale * (pose.InverseTranslation() - anchor);
    pose.translation = -(pose.rotation * centre);
  }
  for (std::size_t i = 0; i < problem->points.size(); ++i) {
    if (!point_is_observed[i]) continue;
    Eigen::Vector3d& position = problem->points[i].position;
    position = anchor + scale * (position - anchor);
  }
}

BundleVerdict ClassifyObservations(const CameraModel& camera, double chi2_gate, SolveState state,
                                   BundleProblem* problem) {
  BundleVerdict verdict;
  const bool is_final = state == SolveState::kConverged;
  const double threshold = std::sqrt(chi2_gate);
  const double unseen_chi2 = kUnseenThresholds * kUnseenThresholds * chi2_gate;
  for (BundleObservation& observation : problem->observations) {
    const Eigen::Vector3d point_in_cam =
        problem->poses[observation.pose_idx].cam_from_world * problem->points[observation.point_idx].position;
    Eigen::Vector2d pixel;
    double chi2 = unseen_chi2;
    bool fits = false;
    if (camera.Project(point_in_cam, &pixel)) {
      chi2 = (pixel - observation.pixel).squaredNorm() / (observation.sigma_px * observation.sigma_px);
      fits = chi2 <= chi2_gate;
    }
    observation.is_outlier = is_final && !fits;
    verdict.cost += 0.5 * HuberLoss(chi2, threshold);
    verdict.num_outliers += observation.is_outlier ? 1 : 0;
  }
  return verdict;
}

}  // namespace haustra::optim
