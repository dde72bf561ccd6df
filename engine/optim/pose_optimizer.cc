#include "engine/optim/pose_optimizer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/geometry/constants.h"
#include "engine/optim/small_least_squares.h"

namespace haustra {
namespace {

constexpr int kMinInliers = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class PoseProblem {
 public:
  PoseProblem(const CameraModel& camera, std::span<const PoseObservation> observations, double chi2_gate,
              std::span<std::uint8_t> inliers)
      : camera_(camera), observations_(observations), chi2_gate_(chi2_gate), inliers_(inliers) {}

  // Robust rounds see all observations, with a scale that follows how far off the estimate is; the others see only
  // those that are marked.
  void StartRobustRound(const SE3& cam_from_world) {
    Chi2Histogram errors;
    for (const PoseObservation& observation : observations_) errors.Add(Chi2(cam_from_world, observation));
    robust_ = GemanMcClure(RobustScale2(errors, chi2_gate_));
    is_robust_ = true;
  }
  void StartFinalRound() { is_robust_ = false; }

  double Cost(const SE3& cam_from_world) const {
    double cost = 0.0;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      if (!is_robust_ && !inliers_[i]) continue;
      const double chi2 = Chi2(cam_from_world, observations_[i]);
      cost += is_robust_ ? robust_.Cost(chi2) : chi2;
    }
    return cost;
  }

  // Normal equations of the observations in use; returns their cost.
  double Linearize(const SE3& cam_from_world, Matrix6d* hessian, Vector6d* gradient) const {
    const Eigen::Matrix3d rotation = cam_from_world.matrix3();
    hessian->setZero();
    gradient->setZero();
    double cost = 0.0;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      if (!is_robust_ && !inliers_[i]) continue;
      const PoseObservation& observation = observations_[i];
      const Eigen::Vector3d point = rotation * observation.point_in_world + cam_from_world.translation;
      Eigen::Vector2d pixel;
      CameraModel::ProjectionJacobian projection;
      if (!camera_.Project(point, &pixel, &projection)) {
        cost += is_robust_ ? robust_.Cost(kInfinity) : kInfinity;
        continue;
      }
      const double inverse_sigma = 1.0 / observation.sigma_px;
      const Eigen::Vector2d residual = (pixel - observation.pixel) * inverse_sigma;
      const double chi2 = residual.squaredNorm();
      const double weight = is_robust_ ? robust_.Weight(chi2) : 1.0;
      cost += is_robust_ ? robust_.Cost(chi2) : chi2;
      projection *= inverse_sigma;
      for (int row = 0; row < 2; ++row) {
        // d point / d (rho, phi) = [I, -Skew(point)], so the rotation's part of a row is point x row.
        const Eigen::Vector3d by_point = projection.row(row);
        Vector6d jacobian;
        jacobian << by_point, point.cross(by_point);
        const Vector6d weighted = weight * jacobian;
        hessian->noalias() += weighted * jacobian.transpose();
        *gradient += residual[row] * weighted;
      }
    }
    return cost;
  }

  static SE3 Moved(const SE3& cam_from_world, const Vector6d& step) { return SE3::Exp(step) * cam_from_world; }

  // Marks every observation anew; returns how many fit.
  int Classify(const SE3& cam_from_world, double* mean_chi2) {
    int count = 0;
    double sum = 0.0;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      const double chi2 = Chi2(cam_from_world, observations_[i]);
      inliers_[i] = chi2 <= chi2_gate_ ? 1 : 0;
      if (!inliers_[i]) continue;
      ++count;
      sum += chi2;
    }
    *mean_chi2 = count > 0 ? sum / count : 0.0;
    return count;
  }

 private:
  // Squared error in sigmas; infinite when the point cannot be seen from the pose.
  double Chi2(const SE3& cam_from_world, const PoseObservation& observation) const {
    Eigen::Vector2d pixel;
    if (!camera_.Project(cam_from_world * observation.point_in_world, &pixel)) return kInfinity;
    return (pixel - observation.pixel).squaredNorm() / (observation.sigma_px * observation.sigma_px);
  }

  const CameraModel& camera_;
  std::span<const PoseObservation> observations_;
  double chi2_gate_;
  GemanMcClure robust_{1.0};
  bool is_robust_ = true;
  std::span<std::uint8_t> inliers_;
};

}  // namespace

bool OptimizePose(const CameraModel& camera, std::span<const PoseObservation> observations,
                  const SE3& initial_cam_from_world, const PoseOptimizerOptions& options,
                  std::span<std::uint8_t> inliers, PoseOptimizerResult* result) {
  *result = PoseOptimizerResult{};
  result->cam_from_world = initial_cam_from_world;
  std::fill(inliers.begin(), inliers.end(), std::uint8_t{0});
  if (inliers.size() != observations.size() || observations.size() < kMinInliers) return false;

  PoseProblem problem(camera, observations, options.chi2_gate, inliers);
  SE3 cam_from_world = initial_cam_from_world;
  int num_inliers = 0;
  double mean_chi2 = 0.0;
  bool converged = false;
  const int robust_rounds = std::max(1, options.rounds / 2);
  for (int round = 0; round < options.rounds; ++round) {
    if (round < robust_rounds) {
      problem.StartRobustRound(cam_from_world);
    } else {
      problem.StartFinalRound();
    }
    converged = MinimizeSmall<6>(problem, options.iterations_per_round, &cam_from_world);
    num_inliers = problem.Classify(cam_from_world, &mean_chi2);
    if (num_inliers < kMinInliers) return false;
  }

  Matrix6d information;
  Vector6d gradient;
  problem.StartFinalRound();
  problem.Linearize(cam_from_world, &information, &gradient);
  if (!IsWellDetermined<6>(information) || !cam_from_world.translation.allFinite()) return false;

  result->cam_from_world = cam_from_world;
  result->num_inliers = num_inliers;
  result->mean_chi2 = mean_chi2;
  result->information = information;
  result->converged = converged;
  return true;
}

PoseUncertainty UncertaintyOf(const Matrix6d& information, double depth) {
  const Eigen::FullPivLU<Matrix6d> solver(information);
  if (!solver.isInvertible()) return {kInfinity, kInfinity};
  const Matrix6d covariance = solver.inverse();
  // A step rho of the left perturbation moves the camera by rho, seen from itself.
  return {std::sqrt(covariance.topLeftCorner<3, 3>().trace()) / depth,
          std::sqrt(covariance.bottomRightCorner<3, 3>().trace()) / kDegree};
}

}  // namespace haustra
