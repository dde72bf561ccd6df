#include "engine/optim/bundle_adjustment.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/optim/bundle_support.h"
#include "engine/optim/reprojection_cost.h"
#include "engine/optim/se3_manifold.h"
#include "engine/optim/should_stop.h"
#include "engine/optim/stop_callback.h"

namespace haustra {
namespace {

using optim::BundleGauge;
using optim::LeftSE3Manifold;
using optim::ReprojectionCost;
using optim::StopCallback;
using PoseParameters = std::array<double, LeftSE3Manifold::kAmbientSize>;

// Free poses up to which the reduced camera system is solved dense: the windows of the mapper, where nearly all poses
// share points and a sparse factorisation has nothing to skip.
constexpr int kMaxDensePoses = 200;

// One call of AdjustBundle. Works on copies: Ceres orders parameters by address, so each kind lies in one array in the
// order of its indices, and the caller's problem is written only when all went well.
class CeresBundle {
 public:
  CeresBundle(const CameraModel& camera, const BundleOptions& options, const BundleProblem& input,
              const BundleGauge& gauge)
      : options_(options),
        huber_(std::sqrt(options.chi2_gate)),
        problem_(ProblemOptions()),
        callback_(options.should_stop, options.deadline, options.clock) {
    points_.reserve(input.points.size());
    for (const BundlePoint& point : input.points) points_.push_back(point.position);
    poses_.resize(input.poses.size());
    is_held_.resize(input.poses.size());
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      LeftSE3Manifold::Store(input.poses[i].cam_from_world, poses_[i].data());
      is_held_[i] = input.poses[i].is_fixed || static_cast<std::int32_t>(i) == gauge.held_pose;
    }
    AddObservations(camera, input);
    // Not SuiteSparse: its sums depend on the BLAS of the machine and on that one's threads.
    solver_.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    solver_.num_threads = 1;
    solver_.function_tolerance = optim::kMinRelativeDecrease;
    solver_.logging_type = ceres::SILENT;
    solver_.callbacks.push_back(&callback_);
  }
  CeresBundle(const CeresBundle&) = delete;
  CeresBundle& operator=(const CeresBundle&) = delete;

  // False when the solver failed. Adds to the iterations of the summary.
  bool Solve(int max_iterations, BundleSummary* summary) {
    solver_.max_num_iterations = max_iterations;
    ceres::Solver::Summary solved;
    ceres::Solve(solver_, &problem_, &solved);
    // The first entry is the state before the first step.
    summary->iterations += std::max(0, static_cast<int>(solved.iterations.size()) - 1);
    has_gained_ = has_gained_ || solved.final_cost < solved.initial_cost;
    return solved.IsSolutionUsable() && std::isfinite(solved.final_cost);
  }

  bool has_stopped() const { return callback_.has_stopped(); }
  SolveState state() const {
    if (!has_stopped()) return SolveState::kConverged;
    return has_gained_ ? SolveState::kPartial : SolveState::kNone;
  }

  void DropOutliers() {
    for (std::size_t i = 0; i < costs_.size(); ++i) {
      const double* parameters[2] = {blocks_[i].first, blocks_[i].second};
      Eigen::Vector2d residual;
      costs_[i].Evaluate(parameters, residual.data(), nullptr);
      if (!(residual.squaredNorm() <= options_.chi2_gate)) costs_[i].Drop();
    }
  }

  void Write(BundleProblem* output) const {
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (is_free_[i]) output->poses[i].cam_from_world = LeftSE3Manifold::Load(poses_[i].data());
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (!output->points[i].is_fixed) output->points[i].position = points_[i];
    }
  }

 private:
  static ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    return options;
  }

  void AddObservations(const CameraModel& camera, const BundleProblem& input) {
    optim::ObservationsByPoint grouped;
    optim::GroupByPoint(input, &grouped);
    blocks_.reserve(input.observations.size());
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    std::vector<bool> has_pose(poses_.size(), false);
    const double unseen_residual = optim::kUnseenThresholds * std::sqrt(options_.chi2_gate);
    for (std::size_t point_idx = 0; point_idx < points_.size(); ++point_idx) {
      double* const point = points_[point_idx].data();
      bool has_point = false;
      for (std::int32_t k = grouped.begin[point_idx]; k < grouped.begin[point_idx + 1]; ++k) {
        const BundleObservation& observation = input.observations[grouped.order[k]];
        if (is_held_[observation.pose_idx] && input.points[point_idx].is_fixed) continue;
        double* const pose = poses_[observation.pose_idx].data();
        costs_.emplace_back(camera, observation, unseen_residual);
        blocks_.emplace_back(pose, point);
        problem_.AddResidualBlock(&costs_.back(), &huber_, pose, point);
        has_point = true;
        has_pose[observation.pose_idx] = true;
      }
      if (!has_point) continue;
      ordering->AddElementToGroup(point, 0);
      if (input.points[point_idx].is_fixed) problem_.SetParameterBlockConstant(point);
    }
    is_free_.assign(poses_.size(), false);
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!has_pose[i]) continue;
      ordering->AddElementToGroup(poses_[i].data(), 1);
      problem_.SetManifold(poses_[i].data(), &manifold_);
      is_free_[i] = !is_held_[i];
      if (is_held_[i]) problem_.SetParameterBlockConstant(poses_[i].data());
    }
    const auto num_free_poses = std::count(is_free_.begin(), is_free_.end(), true);
    solver_.linear_solver_ordering = std::move(ordering);
    solver_.linear_solver_type = num_free_poses <= kMaxDensePoses ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  }

  const BundleOptions& options_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<PoseParameters> poses_;
  std::vector<bool> is_held_;                                    // fixed, or held as the gauge
  std::vector<bool> is_free_;                                    // observed and not held
  std::deque<ReprojectionCost> costs_;                           // Ceres holds pointers to them
  std::vector<std::pair<const double*, const double*>> blocks_;  // pose and point of each cost
  ceres::HuberLoss huber_;
  LeftSE3Manifold manifold_;
  ceres::Problem problem_;
  StopCallback callback_;
  bool has_gained_ = false;
  ceres::Solver::Options solver_;
};

// False when the solver failed.
bool SolveInPhases(const BundleOptions& options, CeresBundle* bundle, BundleSummary* summary) {
  const int first_phase = options.reject_outliers_midway ? (options.max_iterations + 1) / 2 : options.max_iterations;
  if (!bundle->Solve(first_phase, summary)) return false;
  if (first_phase == options.max_iterations || bundle->has_stopped()) return true;
  bundle->DropOutliers();
  return bundle->Solve(options.max_iterations - first_phase, summary);
}

}  // namespace

Result<BundleSummary> AdjustBundle(const CameraModel& camera, const BundleOptions& options, BundleProblem* problem) {
  HAUSTRA_TRY(optim::ValidateBundle(options, *problem));
  const BundleGauge gauge = optim::ChooseGauge(*problem);
  BundleSummary summary;
  summary.initial_cost = optim::ClassifyObservations(camera, options.chi2_gate, summary.state, problem).cost;
  if (gauge.has_free_parameter && !optim::ShouldStop(options.should_stop, options.deadline, options.clock)) {
    try {
      CeresBundle bundle(camera, options, *problem, gauge);
      if (SolveInPhases(options, &bundle, &summary)) summary.state = bundle.state();
      if (summary.state != SolveState::kNone) {
        bundle.Write(problem);
        optim::RestoreScale(gauge, problem);
      }
    } catch (const std::exception& error) {
      return Internal(std::string("bundle adjustment: Ceres threw ") + error.what());
    }
  }
  const optim::BundleVerdict verdict = optim::ClassifyObservations(camera, options.chi2_gate, summary.state, problem);
  summary.final_cost = verdict.cost;
  summary.num_outliers = verdict.num_outliers;
  return summary;
}

}  // namespace haustra
