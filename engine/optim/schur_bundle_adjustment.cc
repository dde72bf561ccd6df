#include "engine/optim/schur_bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <exception>
#include <string>

#include "engine/optim/should_stop.h"

namespace haustra {
namespace {

// Damping relative to the diagonal, as Ceres has it at its start, and how it follows success and failure.
constexpr double kFirstLambda = 1e-4;
constexpr double kMinLambda = 1e-12;
constexpr double kMaxLambda = 1e8;
constexpr double kShrink = 1.0 / 3.0;
constexpr double kGrow = 4.0;
// Observations are linearised and eliminated in stretches of about this many, which stay in the fastest cache.
constexpr std::int32_t kStretch = 64;

std::array<double, optim::kPoseNumbers> Rows(const SE3& pose) {
  const Eigen::Matrix3d r = pose.matrix3();
  const Eigen::Vector3d& t = pose.translation;
  return {r(0, 0), r(0, 1), r(0, 2), t[0], r(1, 0), r(1, 1), r(1, 2), t[1], r(2, 0), r(2, 1), r(2, 2), t[2]};
}

// What the list held is not needed any more, so the old memory goes before the new is taken, and that is no larger than
// it has to be: the heap holds the largest problem once.
template <typename T>
void ResizeAnew(std::vector<T>* list, std::size_t size) {
  if (list->capacity() < size) {
    std::vector<T>().swap(*list);
    list->reserve(size);
  }
  list->resize(size);
}

}  // namespace

void SchurBundleAdjuster::Load(const BundleProblem& problem, const optim::BundleGauge& gauge) {
  optim::GroupByPoint(problem, &grouped_);
  state_.cam_from_world.clear();
  state_.pose_rows.clear();
  std::vector<std::int32_t> free_of_pose(problem.poses.size(), -1);
  std::vector<bool> is_observed(problem.poses.size(), false);
  for (const BundleObservation& observation : problem.observations) is_observed[observation.pose_idx] = true;
  free_poses_.clear();
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    state_.cam_from_world.push_back(problem.poses[i].cam_from_world);
    state_.pose_rows.push_back(Rows(problem.poses[i].cam_from_world));
    const auto idx = static_cast<std::int32_t>(i);
    if (!is_observed[i] || problem.poses[i].is_fixed || idx == gauge.held_pose) continue;
    free_of_pose[i] = static_cast<std::int32_t>(free_poses_.size());
    free_poses_.push_back(idx);
  }
  ResizeObservations(static_cast<int>(problem.observations.size()));
  state_.points.clear();
  input_points_.clear();
  begin_.assign(1, 0);
  std::int32_t longest = 0;
  for (std::size_t j = 0; j < problem.points.size(); ++j) {
    const std::int32_t begin = grouped_.begin[j], end = grouped_.begin[j + 1];
    if (begin == end) continue;
    // By pose, so that the pairs of a point fall into the lower triangle.
    const auto free_pose = [&](std::int32_t input) { return free_of_pose[problem.observations[input].pose_idx]; };
    std::stable_sort(grouped_.order.begin() + begin, grouped_.order.begin() + end,
                     [&](std::int32_t a, std::int32_t b) { return free_pose(a) < free_pose(b); });
    for (std::int32_t o = begin; o < end; ++o) {
      const BundleObservation& input = problem.observations[grouped_.order[o]];
      observations_.u[o] = input.pixel.x();
      observations_.v[o] = input.pixel.y();
      observations_.inverse_sigma[o] = 1.0 / input.sigma_px;
      observations_.pose[o] = input.pose_idx;
      observations_.free_pose[o] = free_of_pose[input.pose_idx];
      observations_.point[o] = static_cast<std::int32_t>(input_points_.size());
    }
    const BundlePoint& point = problem.points[j];
    state_.points.push_back({point.position.x(), point.position.y(), point.position.z(), point.is_fixed ? 0.0 : 1.0});
    input_points_.push_back(static_cast<std::int32_t>(j));
    begin_.push_back(end);
    longest = std::max(longest, end - begin);
  }
  candidate_ = state_;
  const std::size_t num_free = free_poses_.size();
  const std::size_t num_rows = problem.observations.size() + optim::kMaxVectorLanes;
  ResizeAnew(&chi2_, num_rows);
  ResizeAnew(&y_, 18 * num_rows);
  linearised_.resize(optim::LinearisedObservations::kNumbers * (kStretch + longest + optim::kMaxVectorLanes));
  ResizeAnew(&eliminated_, input_points_.size());
  ResizeAnew(&blocks_, 36 * (num_free * (num_free + 1) / 2));
  pose_sums_.resize(12 * num_free);
  step_.resize(static_cast<Eigen::Index>(6 * num_free));
  dense_.resize(static_cast<Eigen::Index>(6 * num_free), static_cast<Eigen::Index>(6 * num_free));
}

void SchurBundleAdjuster::ResizeObservations(int num) {
  const std::size_t num_rows = static_cast<std::size_t>(num) + optim::kMaxVectorLanes;
  for (auto* numbers : {&observations_.u, &observations_.v, &observations_.inverse_sigma}) {
    ResizeAnew(numbers, num_rows);
  }
  for (auto* indices : {&observations_.pose, &observations_.free_pose, &observations_.point}) {
    ResizeAnew(indices, num_rows);
    std::fill(indices->begin() + num, indices->end(), 0);
  }
}

optim::BundleView SchurBundleAdjuster::View(const State& state) const {
  return {.camera = camera_,
          .huber_threshold = std::sqrt(chi2_gate_),
          .unseen_chi2 = optim::kUnseenThresholds * optim::kUnseenThresholds * chi2_gate_,
          .u = observations_.u.data(),
          .v = observations_.v.data(),
          .inverse_sigma = observations_.inverse_sigma.data(),
          .pose = observations_.pose.data(),
          .free_pose = observations_.free_pose.data(),
          .point = observations_.point.data(),
          .begin = begin_.data(),
          .poses = state.pose_rows.empty() ? nullptr : state.pose_rows.front().data(),
          .points = state.points.empty() ? nullptr : state.points.front().data()};
}

double SchurBundleAdjuster::Cost(const State& state) {
  return kernels_.Linearise(View(state), 0, begin_.back(), chi2_.data(), nullptr);
}

double SchurBundleAdjuster::Linearise(const State& state, double lambda) {
  std::fill(blocks_.begin(), blocks_.end(), 0.0);
  std::fill(pose_sums_.begin(), pose_sums_.end(), 0.0);
  const optim::BundleView view = View(state);
  const optim::ReducedSystem system = {
      .blocks = blocks_.data(), .pose_sums = pose_sums_.data(), .points = eliminated_.data(), .y = y_.data()};
  optim::LinearisedObservations linearised = {
      .numbers = linearised_.data(),
      .stride = static_cast<int>(linearised_.size() / optim::LinearisedObservations::kNumbers)};
  double cost = 0.0;
  const auto num_points = static_cast<std::int32_t>(input_points_.size());
  for (std::int32_t point = 0; point < num_points;) {
    const std::int32_t first_point = point;
    linearised.first = begin_[first_point];
    while (point < num_points && begin_[point] < linearised.first + kStretch) ++point;
    cost += kernels_.Linearise(view, linearised.first, begin_[point], chi2_.data(), &linearised);
    kernels_.Eliminate(view, first_point, point, lambda, linearised, system);
  }
  for (std::size_t i = 0; i < free_poses_.size(); ++i) {
    Eigen::Map<Matrix6d> block(Block(static_cast<std::int32_t>(i), static_cast<std::int32_t>(i)));
    const Eigen::Map<const Vector6d> diagonal(pose_sums_.data() + 12 * i + 6);
    const double floor = std::max(optim::kDiagonalFloor * diagonal.maxCoeff(), 1e-30);
    for (int k = 0; k < 6; ++k) block(k, k) += lambda * std::max(diagonal[k], floor);
  }
  return cost;
}

bool SchurBundleAdjuster::Step(const State& state, State* candidate) {
  const auto num_free = static_cast<std::int32_t>(free_poses_.size());
  for (std::int32_t i = 0; i < num_free; ++i) {
    step_.segment<6>(6 * i) = -Eigen::Map<const Vector6d>(pose_sums_.data() + 12 * i);
  }
  if (num_free > 0) {
    for (std::int32_t row = 0; row < num_free; ++row) {
      for (std::int32_t column = 0; column <= row; ++column) {
        dense_.block<6, 6>(6 * row, 6 * column) = Eigen::Map<const Matrix6d>(Block(row, column));
      }
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(dense_);
    if (cholesky.info() != Eigen::Success) return false;
    cholesky.solveInPlace(step_);
    if (!step_.allFinite()) return false;
  }
  for (std::int32_t i = 0; i < num_free; ++i) {
    const std::int32_t pose = free_poses_[i];
    candidate->cam_from_world[pose] = SE3::Exp(step_.segment<6>(6 * i)) * state.cam_from_world[pose];
    candidate->pose_rows[pose] = Rows(candidate->cam_from_world[pose]);
  }
  for (std::size_t j = 0; j < input_points_.size(); ++j) {
    const optim::EliminatedPoint& point = eliminated_[j];
    Eigen::Vector3d d = -Eigen::Map<const Eigen::Vector3d>(point.z);
    for (std::int32_t o = begin_[j]; o < begin_[j + 1]; ++o) {
      const std::int32_t free_pose = observations_.free_pose[o];
      if (free_pose < 0) continue;
      const double* const y = y_.data() + 18 * static_cast<std::size_t>(o);
      d.noalias() -= Eigen::Map<const Eigen::Matrix<double, 4, 3>>(y).transpose() * step_.segment<4>(6 * free_pose);
      d.noalias() -=
          Eigen::Map<const Eigen::Matrix<double, 2, 3>>(y + 12).transpose() * step_.segment<2>(6 * free_pose + 4);
    }
    d[2] *= point.inverse_l22;
    d[1] = (d[1] - point.l21 * d[2]) * point.inverse_l11;
    d[0] = (d[0] - point.l10 * d[1] - point.l20 * d[2]) * point.inverse_l00;
    for (int k = 0; k < 3; ++k) candidate->points[j][k] = state.points[j][k] + d[k];
  }
  return true;
}

bool SchurBundleAdjuster::Minimise(const BundleOptions& options, int max_steps, BundleSummary* summary,
                                   bool* has_gained) {
  double lambda = kFirstLambda;
  double shrink = kShrink;
  double cost = Linearise(state_, lambda);
  if (summary->iterations == 0) summary->initial_cost = cost;
  for (int step = 0; step < max_steps; ++step) {
    if (optim::ShouldStop(options.should_stop, options.deadline, options.clock)) return false;
    ++summary->iterations;
    const bool is_last = step + 1 == max_steps;
    double new_cost = cost;
    bool is_better = false;
    if (Step(state_, &candidate_)) {
      // One pass over the observations tells the cost of the candidate and prepares the step that follows if it is
      // taken; after the last step there is nothing to prepare.
      const double next_lambda = std::max(kMinLambda, lambda * shrink);
      new_cost = is_last ? Cost(candidate_) : Linearise(candidate_, next_lambda);
      is_better = new_cost < cost;
    }
    if (is_better) {
      std::swap(state_, candidate_);
      *has_gained = true;
      const bool has_converged = cost - new_cost < optim::kMinRelativeDecrease * cost;
      cost = new_cost;
      lambda = std::max(kMinLambda, lambda * shrink);
      shrink = kShrink;
      if (has_converged) return true;
    } else {
      lambda *= kGrow;
      // The damping that a failure asked for is kept for one more step, or every other step would fail.
      shrink = 1.0;
      if (lambda > kMaxLambda) return true;
      if (!is_last) Linearise(state_, lambda);
    }
  }
  return true;
}

void SchurBundleAdjuster::DropOutliers() {
  std::int32_t kept = 0, begin = 0;
  for (std::size_t j = 0; j < input_points_.size(); ++j) {
    const std::int32_t end = begin_[j + 1];
    for (std::int32_t o = begin; o < end; ++o) {
      if (!(chi2_[o] <= chi2_gate_)) continue;
      for (auto* numbers : {&observations_.u, &observations_.v, &observations_.inverse_sigma}) {
        (*numbers)[kept] = (*numbers)[o];
      }
      for (auto* indices : {&observations_.pose, &observations_.free_pose, &observations_.point}) {
        (*indices)[kept] = (*indices)[o];
      }
      ++kept;
    }
    begin = end;
    begin_[j + 1] = kept;
  }
  ResizeObservations(kept);
}

void SchurBundleAdjuster::Store(BundleProblem* problem) const {
  for (const std::int32_t pose : free_poses_) problem->poses[pose].cam_from_world = state_.cam_from_world[pose];
  for (std::size_t j = 0; j < input_points_.size(); ++j) {
    BundlePoint& point = problem->points[input_points_[j]];
    if (!point.is_fixed) point.position = Eigen::Map<const Eigen::Vector3d>(state_.points[j].data());
  }
}

Result<BundleSummary> SchurBundleAdjuster::Adjust(const CameraModel& camera, const BundleOptions& options,
                                                  BundleProblem* problem) {
  HAUSTRA_TRY(optim::ValidateBundle(options, *problem));
  const optim::BundleGauge gauge = optim::ChooseGauge(*problem);
  BundleSummary summary;
  try {
    camera_ = camera.projection_constants();
    chi2_gate_ = options.chi2_gate;
    Load(*problem, gauge);
    if (!gauge.has_free_parameter) {
      summary.initial_cost = Cost(state_);
    } else {
      const int first_phase =
          options.reject_outliers_midway ? (options.max_iterations + 1) / 2 : options.max_iterations;
      bool has_gained = false;
      bool is_done = Minimise(options, first_phase, &summary, &has_gained);
      if (first_phase < options.max_iterations && is_done) {
        Cost(state_);  // for chi2: the last pass may have looked at a candidate that was not taken
        DropOutliers();
        is_done = Minimise(options, options.max_iterations - first_phase, &summary, &has_gained);
      }
      summary.state = is_done ? SolveState::kConverged : has_gained ? SolveState::kPartial : SolveState::kNone;
    }
  } catch (const std::exception& error) {
    return Internal(std::string("bundle adjustment: ") + error.what());
  }
  if (summary.state != SolveState::kNone) {
    Store(problem);
    optim::RestoreScale(gauge, problem);
  }
  const optim::BundleVerdict verdict = optim::ClassifyObservations(camera, options.chi2_gate, summary.state, problem);
  summary.final_cost = verdict.cost;
  summary.num_outliers = verdict.num_outliers;
  return summary;
}

Result<BundleSummary> AdjustBundleSchur(const CameraModel& camera, const BundleOptions& options,
                                        BundleProblem* problem) {
  SchurBundleAdjuster adjuster;
  return adjuster.Adjust(camera, options, problem);
}

}  // namespace haustra
