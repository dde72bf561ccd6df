#include "engine/optim/sim3_optimizer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/optim/small_least_squares.h"

namespace haustra {
namespace {

constexpr int kMinSim3Inliers = 4;
constexpr double kInfiniteCost = std::numeric_limits<double>::infinity();

class Sim3Problem {
 public:
  Sim3Problem(const CameraModel& camera, std::span<const Sim3Match> matches, std::span<const SE3> views_a,
              std::span<const SE3> views_b, const Sim3OptimizerOptions& options, std::span<std::uint8_t> inliers)
      : camera_(camera),
        matches_(matches),
        views_a_(views_a),
        views_b_(views_b),
        chi2_gate_(options.chi2_gate),
        inliers_(inliers) {}

  // As in pose_optimizer.cc.
  void StartRobustRound(const Sim3& b_from_a) {
    const Sim3 a_from_b = b_from_a.Inverse();
    Chi2Histogram errors;
    for (const Sim3Match& match : matches_) errors.Add(Chi2(b_from_a, a_from_b, match));
    robust_ = GemanMcClure(RobustScale2(errors, chi2_gate_));
    is_robust_ = true;
  }
  void StartFinalRound() { is_robust_ = false; }

  double Linearize(const Sim3& b_from_a, Matrix7d* hessian, Vector7d* gradient) const {
    const Sim3 a_from_b = b_from_a.Inverse();
    const Eigen::Matrix3d scaled_rotation_a_from_b = a_from_b.scale * a_from_b.rotation.toRotationMatrix();
    hessian->setZero();
    gradient->setZero();
    double cost = 0.0;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (!is_robust_ && !inliers_[i]) continue;
      const Sim3Match& match = matches_[i];
      const SE3& view_a = views_a_[match.view_a];
      const SE3& view_b = views_b_[match.view_b];
      const Eigen::Vector3d moved_a = b_from_a * match.point_in_a;
      Eigen::Vector2d pixel_a, pixel_b;
      CameraModel::ProjectionJacobian projection_a, projection_b;
      if (!camera_.Project(view_b * moved_a, &pixel_b, &projection_b) ||
          !camera_.Project(view_a * (a_from_b * match.point_in_b), &pixel_a, &projection_a)) {
        cost += is_robust_ ? robust_.Cost(kInfiniteCost) : kInfiniteCost;
        continue;
      }
      const Eigen::Vector2d residual_b = (pixel_b - match.pixel_in_b) / match.sigma_b_px;
      const Eigen::Vector2d residual_a = (pixel_a - match.pixel_in_a) / match.sigma_a_px;
      const double chi2 = residual_a.squaredNorm() + residual_b.squaredNorm();
      const double weight = is_robust_ ? robust_.Weight(chi2) : 1.0;
      cost += is_robust_ ? robust_.Cost(chi2) : chi2;
      // A point q of b moves by rho + phi x q + lambda q; the reverse direction sees the same motion backwards, through
      // the linear part of a_from_b.
      const CameraModel::ProjectionJacobian by_b = projection_b * view_b.matrix3() / match.sigma_b_px;
      const CameraModel::ProjectionJacobian by_a =
          -projection_a * view_a.matrix3() * scaled_rotation_a_from_b / match.sigma_a_px;
      for (int row = 0; row < 2; ++row) {
        Accumulate(by_b.row(row), moved_a, residual_b[row], weight, hessian, gradient);
        Accumulate(by_a.row(row), match.point_in_b, residual_a[row], weight, hessian, gradient);
      }
    }
    return cost;
  }

  static Sim3 Moved(const Sim3& b_from_a, const Vector7d& step) { return Sim3FromTangent(step) * b_from_a; }

  int Classify(const Sim3& b_from_a, double* mean_chi2) {
    const Sim3 a_from_b = b_from_a.Inverse();
    int count = 0;
    double sum = 0.0;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      const double chi2 = Chi2(b_from_a, a_from_b, matches_[i]);
      inliers_[i] = chi2 <= chi2_gate_ ? 1 : 0;
      if (!inliers_[i]) continue;
      ++count;
      sum += chi2;
    }
    *mean_chi2 = count > 0 ? sum / count : 0.0;
    return count;
  }

 private:
  double Chi2(const Sim3& b_from_a, const Sim3& a_from_b, const Sim3Match& match) const {
    Eigen::Vector2d pixel_a, pixel_b;
    if (!camera_.Project(views_b_[match.view_b] * (b_from_a * match.point_in_a), &pixel_b)) return kInfiniteCost;
    if (!camera_.Project(views_a_[match.view_a] * (a_from_b * match.point_in_b), &pixel_a)) return kInfiniteCost;
    return (pixel_a - match.pixel_in_a).squaredNorm() / (match.sigma_a_px * match.sigma_a_px) +
           (pixel_b - match.pixel_in_b).squaredNorm() / (match.sigma_b_px * match.sigma_b_px);
  }

  static void Accumulate(const Eigen::RowVector3d& by_point, const Eigen::Vector3d& point, double residual,
                         double weight, Matrix7d* hessian, Vector7d* gradient) {
    const Eigen::Vector3d row = by_point.transpose();
    Vector7d jacobian;
    jacobian << row, point.cross(row), row.dot(point);
    const Vector7d weighted = weight * jacobian;
    hessian->noalias() += weighted * jacobian.transpose();
    *gradient += residual * weighted;
  }

  const CameraModel& camera_;
  std::span<const Sim3Match> matches_;
  std::span<const SE3> views_a_;
  std::span<const SE3> views_b_;
  double chi2_gate_;
  GemanMcClure robust_{1.0};
  bool is_robust_ = true;
  std::span<std::uint8_t> inliers_;
};

}  // namespace

Sim3 Sim3FromTangent(const Vector7d& tangent) {
  return Sim3(std::exp(tangent[6]), ExpSO3(tangent.segment<3>(3)), tangent.head<3>());
}

bool OptimizeSim3(const CameraModel& camera, std::span<const Sim3Match> matches, std::span<const SE3> views_a,
                  std::span<const SE3> views_b, const Sim3& initial_b_from_a, const Sim3OptimizerOptions& options,
                  std::span<std::uint8_t> inliers, Sim3OptimizerResult* result) {
  *result = Sim3OptimizerResult{};
  result->b_from_a = initial_b_from_a;
  std::fill(inliers.begin(), inliers.end(), std::uint8_t{0});
  if (inliers.size() != matches.size() || matches.size() < kMinSim3Inliers) return false;
  for (const Sim3Match& match : matches) {
    if (match.view_a < 0 || match.view_a >= static_cast<int>(views_a.size())) return false;
    if (match.view_b < 0 || match.view_b >= static_cast<int>(views_b.size())) return false;
  }

  Sim3Problem problem(camera, matches, views_a, views_b, options, inliers);
  Sim3 b_from_a = initial_b_from_a;
  int num_inliers = 0;
  double mean_chi2 = 0.0;
  bool converged = false;
  const int robust_rounds = std::max(1, options.rounds / 2);
  for (int round = 0; round < options.rounds; ++round) {
    if (round < robust_rounds) {
      problem.StartRobustRound(b_from_a);
    } else {
      problem.StartFinalRound();
    }
    converged = MinimizeSmall<7>(problem, options.iterations_per_round, &b_from_a);
    num_inliers = problem.Classify(b_from_a, &mean_chi2);
    if (num_inliers < kMinSim3Inliers) return false;
  }

  Matrix7d information;
  Vector7d gradient;
  problem.StartFinalRound();
  problem.Linearize(b_from_a, &information, &gradient);
  if (!IsWellDetermined<7>(information) || !b_from_a.translation.allFinite() || !(b_from_a.scale > 0.0)) return false;

  result->b_from_a = b_from_a;
  result->num_inliers = num_inliers;
  result->mean_chi2 = mean_chi2;
  result->information = information;
  result->converged = converged;
  return true;
}

}  // namespace haustra
