#include "engine/optim/schur_bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstring>
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
// Floor of a diagonal element for damping, relative to the largest of its block: a direction that nothing observes.
constexpr double kDiagonalFloor = 1e-6;

// Two doubles that the compiler keeps in one register (SSE2, NEON). Left to itself it does not see that a column of six
// is three of them.
using Pair = double __attribute__((vector_size(16)));

Pair LoadPair(const double* from) {
  Pair pair;
  std::memcpy(&pair, from, sizeof pair);
  return pair;
}
void StorePair(double* to, Pair pair) { std::memcpy(to, &pair, sizeof pair); }

// s -= a b^T, column-major: a and b 6x3, s 6x6. The innermost loop: once for each pair of views of a point.
void SubtractProduct(const double* a, const double* b, double* s) {
  Pair columns[3][3];
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 3; ++i) columns[c][i] = LoadPair(a + 6 * c + 2 * i);
  }
  for (int column = 0; column < 6; ++column) {
    const double b0 = b[column], b1 = b[6 + column], b2 = b[12 + column];
    double* const to = s + 6 * column;
    for (int i = 0; i < 3; ++i) {
      const Pair product = columns[0][i] * b0 + columns[1][i] * b1 + columns[2][i] * b2;
      StorePair(to + 2 * i, LoadPair(to + 2 * i) - product);
    }
  }
}

}  // namespace

void SchurBundleAdjuster::Load(const BundleProblem& problem, const optim::BundleGauge& gauge) {
  optim::GroupByPoint(problem, &grouped_);
  state_.poses.clear();
  std::vector<std::int32_t> free_of_pose(problem.poses.size(), -1);
  std::vector<bool> is_observed(problem.poses.size(), false);
  for (const BundleObservation& observation : problem.observations) is_observed[observation.pose_idx] = true;
  free_poses_.clear();
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    const SE3& pose = problem.poses[i].cam_from_world;
    state_.poses.push_back({pose, pose.matrix3()});
    const auto idx = static_cast<std::int32_t>(i);
    if (!is_observed[i] || problem.poses[i].is_fixed || idx == gauge.held_pose) continue;
    free_of_pose[i] = static_cast<std::int32_t>(free_poses_.size());
    free_poses_.push_back(idx);
  }
  points_.clear();
  state_.points.clear();
  observations_.clear();
  for (std::size_t j = 0; j < problem.points.size(); ++j) {
    const std::int32_t begin = static_cast<std::int32_t>(observations_.size());
    for (std::int32_t k = grouped_.begin[j]; k < grouped_.begin[j + 1]; ++k) {
      const BundleObservation& input = problem.observations[grouped_.order[k]];
      observations_.push_back({.pixel = input.pixel,
                               .inverse_sigma = 1.0 / input.sigma_px,
                               .pose = input.pose_idx,
                               .free_pose = free_of_pose[input.pose_idx],
                               .input = grouped_.order[k],
                               .is_active = true});
    }
    const std::int32_t end = static_cast<std::int32_t>(observations_.size());
    if (begin == end) continue;
    // By pose, so that the pairs of a point fall into the lower triangle.
    std::stable_sort(observations_.begin() + begin, observations_.end(),
                     [](const Observation& a, const Observation& b) { return a.free_pose < b.free_pose; });
    points_.push_back({begin, end, static_cast<std::int32_t>(j), problem.points[j].is_fixed});
    state_.points.push_back(problem.points[j].position);
  }
  candidate_ = state_;
  const std::size_t num_free = free_poses_.size();
  chi2_.resize(observations_.size());
  eliminated_y_.resize(observations_.size());
  eliminated_.resize(points_.size());
  blocks_.resize(36 * (num_free * (num_free + 1) / 2));
  pose_diagonal_.resize(num_free);
  gradient_.resize(static_cast<Eigen::Index>(6 * num_free));
  dense_.resize(static_cast<Eigen::Index>(6 * num_free), static_cast<Eigen::Index>(6 * num_free));
}

double SchurBundleAdjuster::Cost(const CameraModel& camera, const State& state) {
  const double gate = threshold_ * threshold_;
  const double unseen_chi2 = optim::kUnseenThresholds * optim::kUnseenThresholds * gate;
  double cost = 0.0;
  for (std::size_t j = 0; j < points_.size(); ++j) {
    for (std::int32_t o = points_[j].begin; o < points_[j].end; ++o) {
      const Observation& observation = observations_[o];
      if (!observation.is_active) continue;
      const Pose& pose = state.poses[observation.pose];
      const Eigen::Vector3d point_in_cam = pose.rotation * state.points[j] + pose.cam_from_world.translation;
      Eigen::Vector2d pixel;
      chi2_[o] = unseen_chi2;
      if (camera.Project(point_in_cam, &pixel)) {
        chi2_[o] = ((pixel - observation.pixel) * observation.inverse_sigma).squaredNorm();
      }
      cost += 0.5 * optim::HuberLoss(chi2_[o], threshold_);
    }
  }
  return cost;
}

double SchurBundleAdjuster::Linearise(const CameraModel& camera, const State& state, double lambda) {
  const double gate = threshold_ * threshold_;
  const double unseen_chi2 = optim::kUnseenThresholds * optim::kUnseenThresholds * gate;
  std::fill(blocks_.begin(), blocks_.end(), 0.0);
  std::fill(pose_diagonal_.begin(), pose_diagonal_.end(), Vector6::Zero());
  gradient_.setZero();
  double cost = 0.0;
  for (std::size_t j = 0; j < points_.size(); ++j) {
    const Point& point = points_[j];
    Eigen::Matrix3d v = Eigen::Matrix3d::Zero();
    Eigen::Vector3d point_gradient = Eigen::Vector3d::Zero();
    for (std::int32_t o = point.begin; o < point.end; ++o) {
      const Observation& observation = observations_[o];
      if (!observation.is_active) continue;
      const Pose& pose = state.poses[observation.pose];
      const Eigen::Vector3d point_in_cam = pose.rotation * state.points[j] + pose.cam_from_world.translation;
      Eigen::Vector2d pixel;
      CameraModel::ProjectionJacobian d_cam;
      if (!camera.Project(point_in_cam, &pixel, &d_cam)) {
        chi2_[o] = unseen_chi2;
        cost += 0.5 * optim::HuberLoss(unseen_chi2, threshold_);
        eliminated_y_[o].setZero();
        continue;
      }
      Eigen::Vector2d residual = (pixel - observation.pixel) * observation.inverse_sigma;
      const double chi2 = residual.squaredNorm();
      chi2_[o] = chi2;
      cost += 0.5 * optim::HuberLoss(chi2, threshold_);
      // Iteratively reweighted least squares: the derivative of Huber's loss as a weight.
      const double root_weight = chi2 <= gate ? 1.0 : std::sqrt(threshold_ / std::sqrt(chi2));
      residual *= root_weight;
      d_cam *= observation.inverse_sigma * root_weight;
      const CameraModel::ProjectionJacobian d_point = d_cam * pose.rotation;
      if (!point.is_fixed) {
        v.noalias() += d_point.transpose() * d_point;
        point_gradient.noalias() += d_point.transpose() * residual;
      }
      if (observation.free_pose < 0) continue;
      // Rows of d residual / d (rho, phi): [a, point_in_cam x a] with a a row of d_cam.
      Eigen::Matrix<double, 2, 6> d_pose;
      d_pose.leftCols<3>() = d_cam;
      d_pose.row(0).tail<3>() = point_in_cam.cross(d_cam.row(0).transpose()).transpose();
      d_pose.row(1).tail<3>() = point_in_cam.cross(d_cam.row(1).transpose()).transpose();
      Eigen::Map<Matrix6> diagonal_block(Block(observation.free_pose, observation.free_pose));
      diagonal_block.noalias() += d_pose.transpose() * d_pose;
      gradient_.segment<6>(6 * observation.free_pose).noalias() += d_pose.transpose() * residual;
      pose_diagonal_[observation.free_pose] += d_pose.colwise().squaredNorm().transpose();
      if (!point.is_fixed) eliminated_y_[o].noalias() = d_pose.transpose() * d_point;
    }
    Eliminated& eliminated = eliminated_[j];
    eliminated.is_valid = false;
    const double largest = v.diagonal().maxCoeff();
    if (point.is_fixed || !(largest > 0)) continue;
    for (int i = 0; i < 3; ++i) v(i, i) += lambda * std::max(v(i, i), kDiagonalFloor * largest);
    eliminated.l00 = std::sqrt(v(0, 0));
    eliminated.l10 = v(1, 0) / eliminated.l00;
    eliminated.l20 = v(2, 0) / eliminated.l00;
    eliminated.l11 = std::sqrt(v(1, 1) - eliminated.l10 * eliminated.l10);
    eliminated.l21 = (v(2, 1) - eliminated.l20 * eliminated.l10) / eliminated.l11;
    eliminated.l22 = std::sqrt(v(2, 2) - eliminated.l20 * eliminated.l20 - eliminated.l21 * eliminated.l21);
    if (!(eliminated.l11 > 0) || !(eliminated.l22 > 0)) continue;  // rank lost to rounding: the point waits
    eliminated.is_valid = true;
    const double i0 = 1.0 / eliminated.l00, i1 = 1.0 / eliminated.l11, i2 = 1.0 / eliminated.l22;
    Eigen::Vector3d& g = eliminated.gradient;
    g[0] = point_gradient[0] * i0;
    g[1] = (point_gradient[1] - eliminated.l10 * g[0]) * i1;
    g[2] = (point_gradient[2] - eliminated.l20 * g[0] - eliminated.l21 * g[1]) * i2;
    for (std::int32_t o = point.begin; o < point.end; ++o) {
      const std::int32_t row = observations_[o].free_pose;
      if (row < 0 || !observations_[o].is_active) continue;
      Matrix63& y = eliminated_y_[o];
      y.col(0) *= i0;
      y.col(1) = (y.col(1) - eliminated.l10 * y.col(0)) * i1;
      y.col(2) = (y.col(2) - eliminated.l20 * y.col(0) - eliminated.l21 * y.col(1)) * i2;
      gradient_.segment<6>(6 * row).noalias() -= y * g;
      for (std::int32_t other = point.begin; other <= o; ++other) {
        const std::int32_t column = observations_[other].free_pose;
        if (column < 0 || !observations_[other].is_active) continue;
        SubtractProduct(y.data(), eliminated_y_[other].data(), Block(row, column));
      }
    }
  }
  for (std::size_t i = 0; i < free_poses_.size(); ++i) {
    Eigen::Map<Matrix6> block(Block(static_cast<std::int32_t>(i), static_cast<std::int32_t>(i)));
    const Vector6& diagonal = pose_diagonal_[i];
    const double floor = std::max(kDiagonalFloor * diagonal.maxCoeff(), 1e-30);
    for (int k = 0; k < 6; ++k) block(k, k) += lambda * std::max(diagonal[k], floor);
  }
  return cost;
}

bool SchurBundleAdjuster::Step(const State& state, State* candidate) {
  const auto num_free = static_cast<std::int32_t>(free_poses_.size());
  step_ = -gradient_;
  if (num_free > 0) {
    for (std::int32_t row = 0; row < num_free; ++row) {
      for (std::int32_t column = 0; column <= row; ++column) {
        dense_.block<6, 6>(6 * row, 6 * column) = Eigen::Map<const Matrix6>(Block(row, column));
      }
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(dense_);
    if (cholesky.info() != Eigen::Success) return false;
    cholesky.solveInPlace(step_);
    if (!step_.allFinite()) return false;
  }
  for (std::int32_t i = 0; i < num_free; ++i) {
    const Pose& from = state.poses[free_poses_[i]];
    Pose& to = candidate->poses[free_poses_[i]];
    to.cam_from_world = SE3::Exp(step_.segment<6>(6 * i)) * from.cam_from_world;
    to.rotation = to.cam_from_world.matrix3();
  }
  for (std::size_t j = 0; j < points_.size(); ++j) {
    const Eliminated& eliminated = eliminated_[j];
    if (!eliminated.is_valid) {
      candidate->points[j] = state.points[j];
      continue;
    }
    Eigen::Vector3d d = -eliminated.gradient;
    for (std::int32_t o = points_[j].begin; o < points_[j].end; ++o) {
      const Observation& observation = observations_[o];
      if (observation.free_pose < 0 || !observation.is_active) continue;
      d.noalias() -= eliminated_y_[o].transpose() * step_.segment<6>(6 * observation.free_pose);
    }
    d[2] = d[2] / eliminated.l22;
    d[1] = (d[1] - eliminated.l21 * d[2]) / eliminated.l11;
    d[0] = (d[0] - eliminated.l10 * d[1] - eliminated.l20 * d[2]) / eliminated.l00;
    candidate->points[j] = state.points[j] + d;
  }
  return true;
}

void SchurBundleAdjuster::Minimise(const CameraModel& camera, const BundleOptions& options, int max_steps,
                                   BundleSummary* summary) {
  double lambda = kFirstLambda;
  double shrink = kShrink;
  double cost = Linearise(camera, state_, lambda);
  if (summary->iterations == 0) summary->initial_cost = cost;
  for (int step = 0; step < max_steps; ++step) {
    if (optim::ShouldStop(options.cancel, options.deadline, options.clock)) {
      summary->cancelled = true;
      return;
    }
    ++summary->iterations;
    const bool is_last = step + 1 == max_steps;
    double new_cost = cost;
    bool is_better = false;
    if (Step(state_, &candidate_)) {
      // One pass over the observations tells the cost of the candidate and prepares the step that follows if it is
      // taken; after the last step there is nothing to prepare.
      const double next_lambda = std::max(kMinLambda, lambda * shrink);
      new_cost = is_last ? Cost(camera, candidate_) : Linearise(camera, candidate_, next_lambda);
      is_better = new_cost < cost;
    }
    if (is_better) {
      std::swap(state_, candidate_);
      const bool has_converged = cost - new_cost < optim::kMinRelativeDecrease * cost;
      cost = new_cost;
      lambda = std::max(kMinLambda, lambda * shrink);
      shrink = kShrink;
      if (has_converged) return;
    } else {
      lambda *= kGrow;
      // The damping that a failure asked for is kept for one more step, or every other step would fail.
      shrink = 1.0;
      if (lambda > kMaxLambda) return;
      if (!is_last) Linearise(camera, state_, lambda);
    }
  }
}

void SchurBundleAdjuster::DropOutliers(double chi2_gate) {
  for (std::size_t o = 0; o < observations_.size(); ++o) observations_[o].is_active = chi2_[o] <= chi2_gate;
}

void SchurBundleAdjuster::Store(BundleProblem* problem) const {
  for (const std::int32_t pose : free_poses_) problem->poses[pose].cam_from_world = state_.poses[pose].cam_from_world;
  for (std::size_t j = 0; j < points_.size(); ++j) {
    if (!points_[j].is_fixed) problem->points[points_[j].input].position = state_.points[j];
  }
}

Result<BundleSummary> SchurBundleAdjuster::Adjust(const CameraModel& camera, const BundleOptions& options,
                                                  BundleProblem* problem) {
  HAUSTRA_TRY(optim::ValidateBundle(options, *problem));
  const optim::BundleGauge gauge = optim::ChooseGauge(*problem);
  BundleSummary summary;
  try {
    threshold_ = std::sqrt(options.chi2_gate);
    Load(*problem, gauge);
    if (!gauge.has_free_parameter) {
      summary.initial_cost = Cost(camera, state_);
    } else {
      const int first_phase =
          options.reject_outliers_midway ? (options.max_iterations + 1) / 2 : options.max_iterations;
      Minimise(camera, options, first_phase, &summary);
      if (first_phase < options.max_iterations && !summary.cancelled) {
        Cost(camera, state_);  // for chi2: the last pass may have looked at a candidate that was not taken
        DropOutliers(options.chi2_gate);
        Minimise(camera, options, options.max_iterations - first_phase, &summary);
      }
      summary.usable = true;
    }
  } catch (const std::exception& error) {
    return Internal(std::string("bundle adjustment: ") + error.what());
  }
  if (summary.iterations > 0) {
    Store(problem);
    optim::RestoreScale(gauge, problem);
  }
  const optim::BundleVerdict verdict = optim::ClassifyObservations(camera, options.chi2_gate, problem);
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
