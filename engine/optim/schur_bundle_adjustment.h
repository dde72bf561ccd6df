// Bundle adjustment without Ceres: the same problem, options, cost and verdict as AdjustBundle, solved by a
// Levenberg-Marquardt of our own that knows the structure (points of three numbers, poses of six, one camera) and
// touches every observation once a step. Ceres stays as its twin in the tests.
// Lourakis, Argyros 2009, "SBA"; Triggs et al. 2000, section 6.1 (Schur complement).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "engine/optim/bundle_adjustment.h"
#include "engine/optim/bundle_kernels.h"
#include "engine/optim/bundle_support.h"

namespace haustra {

// Keeps its memory between calls: about 190 bytes an observation, 150 a point and 288 a pair of free poses; it grows to
// the largest problem seen. thread-bound(its owner); not for the tracking thread.
// Deterministic to the bit for the same input on one machine when nothing stops it: one thread, sums in the order of
// the points, one instruction set. Cost: 20 ms for 20 poses, 4000 points, 24000 observations and 10 iterations on one
// x86-64 core at 2.6 GHz with AVX2, 35 ms without (Ceres: 190 ms; engine/optim/benchmarks). Half of it goes into the
// elimination of the points, of that half into the products of pairs of views; a quarter into projections and
// Jacobians.
class SchurBundleAdjuster {
 public:
  // The instruction set is this machine's best, unless a test wants to see another.
  explicit SchurBundleAdjuster(const optim::BundleKernels& kernels = optim::BundleKernelsFor(optim::BestVectorLevel()))
      : kernels_(kernels) {}

  // As AdjustBundle. Meant for windows: the reduced system is dense, its cost grows with the cube of the free poses.
  Result<BundleSummary> Adjust(const CameraModel& camera, const BundleOptions& options, BundleProblem* problem);

 private:
  // What an iteration knows of the world. Two exist: the accepted one and the candidate.
  struct State {
    std::vector<SE3> cam_from_world;
    std::vector<std::array<double, optim::kPoseNumbers>> pose_rows;  // the same, as the kernels want it
    std::vector<std::array<double, optim::kPointNumbers>> points;
  };
  // One entry an observation and then kMaxVectorLanes more; grouped by point, within a point by free pose.
  struct Observations {
    std::vector<double> u, v, inverse_sigma;
    std::vector<std::int32_t> pose, free_pose, point;
  };

  void Load(const BundleProblem& problem, const optim::BundleGauge& gauge);
  void ResizeObservations(int num);
  optim::BundleView View(const State& state) const;
  // The cost of a state; also leaves chi2 of every observation in `chi2_`.
  double Cost(const State& state);
  // The cost of a state, and the reduced system of its linearisation damped by `lambda`.
  double Linearise(const State& state, double lambda);
  // Solves what Linearise left and writes the moved state to `candidate`. False when the system is not positive
  // definite.
  bool Step(const State& state, State* candidate);
  // Up to `max_steps` steps from `state_`, which ends as the best state found. False when it was stopped; sets
  // `has_gained` when any step lowered the cost.
  bool Minimise(const BundleOptions& options, int max_steps, BundleSummary* summary, bool* has_gained);
  void DropOutliers();
  void Store(BundleProblem* problem) const;

  double* Block(std::int32_t row, std::int32_t column) {
    return blocks_.data() + 36 * (static_cast<std::size_t>(row) * (row + 1) / 2 + column);
  }

  const optim::BundleKernels& kernels_;
  ProjectionConstants camera_;
  double chi2_gate_ = 0.0;  // the square of Huber's threshold
  Observations observations_;
  std::vector<std::int32_t> input_points_;  // those with observations, as indices in the problem
  std::vector<std::int32_t> begin_;         // of the observations of each, and the end
  std::vector<std::int32_t> free_poses_;    // pose index of each free pose
  State state_;
  State candidate_;
  std::vector<double> chi2_;                        // of each observation, at the last state that Cost or Linearise saw
  std::vector<double> linearised_;                  // LinearisedObservations of one stretch
  std::vector<double> y_;                           // W L^-T of each observation of a free pose, as ReducedSystem
  std::vector<optim::EliminatedPoint> eliminated_;  // of each point
  std::vector<double> blocks_;     // lower block triangle of the reduced system, 6x6 column-major blocks by rows
  std::vector<double> pose_sums_;  // as ReducedSystem
  Eigen::MatrixXd dense_;
  Eigen::VectorXd step_;
  optim::ObservationsByPoint grouped_;
};

// One call with memory of its own.
Result<BundleSummary> AdjustBundleSchur(const CameraModel& camera, const BundleOptions& options,
                                        BundleProblem* problem);

}  // namespace haustra
