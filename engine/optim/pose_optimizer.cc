#include "engine/optim/pose_optimizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "engine/geometry/constants.h"
#include "engine/optim/pose_kernels.h"
#include "engine/optim/small_least_squares.h"

namespace haustra {
namespace {

constexpr int kMinInliers = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What the kernels read of an observation.
static_assert(sizeof(PoseObservation) == optim::kPoseObservationNumbers * sizeof(double));
static_assert(offsetof(PoseObservation, point_in_world) == 0);
static_assert(offsetof(PoseObservation, pixel) == 4 * sizeof(double));
static_assert(offsetof(PoseObservation, sigma_px) == 6 * sizeof(double));

class PoseProblem {
 public:
  PoseProblem(const CameraModel& camera, std::span<const PoseObservation> observations, double chi2_gate,
              std::span<std::uint8_t> inliers)
      : kernels_(optim::PoseKernelsFor(optim::BestVectorLevel())), chi2_gate_(chi2_gate), inliers_(inliers) {
    view_.camera = camera.projection_constants();
    view_.observations = observations.front().point_in_world.data();
    view_.num = static_cast<int>(observations.size());
  }

  // Robust rounds see all observations, with a scale that follows how far off the estimate is.
  void StartRobustRound(const SE3& cam_from_world) {
    Chi2Histogram errors;
    ForEachChi2(cam_from_world, [&](int, double chi2) { errors.Add(chi2); });
    view_.used = nullptr;
    view_.robust_scale2 = RobustScale2(errors, chi2_gate_);
  }
  // The others see only those that are marked. False: these are those of the last round.
  bool StartFinalRound() {
    const bool is_new = view_.used == nullptr || has_changed_;
    view_.used = inliers_.data();
    view_.robust_scale2 = 0.0;
    return is_new;
  }

  // Normal equations of the observations in use; returns their cost.
  double Linearize(const SE3& cam_from_world, Matrix6d* hessian, Vector6d* gradient) const {
    optim::PoseNormals normals;
    const double cost = kernels_.Linearise(view_, PoseNumbers(cam_from_world).data(), &normals);
    const double* number = normals.numbers + optim::PoseNormals::kHessian;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j) (*hessian)(i, j) = (*hessian)(j, i) = *number++;
    }
    *gradient = Eigen::Map<const Vector6d>(normals.numbers + optim::PoseNormals::kGradient);
    return cost;
  }

  static SE3 Moved(const SE3& cam_from_world, const Vector6d& step) { return SE3::Exp(step) * cam_from_world; }

  // Marks every observation anew; returns how many fit.
  int Classify(const SE3& cam_from_world, double* mean_chi2) {
    int count = 0;
    double sum = 0.0;
    has_changed_ = false;
    ForEachChi2(cam_from_world, [&](int i, double chi2) {
      const std::uint8_t is_inlier = chi2 <= chi2_gate_ ? 1 : 0;
      has_changed_ = has_changed_ || is_inlier != inliers_[i];
      inliers_[i] = is_inlier;
      if (!is_inlier) return;
      ++count;
      sum += chi2;
    });
    *mean_chi2 = count > 0 ? sum / count : 0.0;
    return count;
  }

 private:
  using PoseRows = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  static PoseRows PoseNumbers(const SE3& cam_from_world) {
    PoseRows rows;
    rows << cam_from_world.matrix3(), cam_from_world.translation;
    return rows;
  }

  // Squared error in sigmas; infinite when the point cannot be seen from the pose.
  template <typename Visit>
  void ForEachChi2(const SE3& cam_from_world, Visit visit) const {
    constexpr int kBlock = 64;
    std::array<double, kBlock + optim::kMaxVectorLanes> chi2;
    const PoseRows pose = PoseNumbers(cam_from_world);
    for (int begin = 0; begin < view_.num; begin += kBlock) {
      const int end = std::min(begin + kBlock, view_.num);
      kernels_.Errors(view_, pose.data(), begin, end, chi2.data());
      for (int i = begin; i < end; ++i) visit(i, chi2[i - begin]);
    }
  }

  const optim::PoseKernels& kernels_;
  optim::PoseView view_;
  double chi2_gate_;
  bool has_changed_ = true;  // what is marked
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
    // A robust round goes on where the last one ended, which may be a plateau. Squares of the same observations have
    // the same minimum.
    if (round < robust_rounds) {
      problem.StartRobustRound(cam_from_world);
    } else if (!problem.StartFinalRound() && converged) {
      break;
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
