// Bundle adjustment without Ceres: the same problem, options, cost and verdict as AdjustBundle, solved by a
// Levenberg-Marquardt of our own that knows the structure (points of three numbers, poses of six, one camera) and
// touches every observation once a step. Ceres stays as its twin in the tests.
// Lourakis, Argyros 2009, "SBA"; Triggs et al. 2000, section 6.1 (Schur complement).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "engine/optim/bundle_adjustment.h"
#include "engine/optim/bundle_support.h"

namespace haustra {

// Keeps its memory between calls: about 250 bytes an observation, 150 a point and 288 a pair of free poses; it grows to
// the largest problem seen. thread-bound(its owner); not for the tracking thread.
// Deterministic to the bit for the same input on one machine when nothing cancels: one thread, sums in the order of the
// points.
class SchurBundleAdjuster {
 public:
  // As AdjustBundle. Meant for windows: the reduced system is dense, its cost grows with the cube of the free poses.
  Result<BundleSummary> Adjust(const CameraModel& camera, const BundleOptions& options, BundleProblem* problem);

 private:
  using Vector6 = Eigen::Vector<double, 6>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Matrix63 = Eigen::Matrix<double, 6, 3>;

  struct Pose {
    SE3 cam_from_world;
    Eigen::Matrix3d rotation;  // the same, as a matrix
  };
  // What an iteration knows of the world. Two exist: the accepted one and the candidate.
  struct State {
    std::vector<Pose> poses;
    std::vector<Eigen::Vector3d> points;
  };
  struct Observation {
    Eigen::Vector2d pixel;
    double inverse_sigma;
    std::int32_t pose;
    std::int32_t free_pose;  // index among the free poses, or -1
    std::int32_t input;      // index in the problem
    bool is_active;
  };
  struct Point {
    std::int32_t begin;  // of its observations
    std::int32_t end;
    std::int32_t input;
    bool is_fixed;
  };
  // What the elimination of a point leaves for its back substitution: L of V = L L^T (lower triangle by rows) and L^-1
  // g.
  struct Eliminated {
    double l00, l10, l11, l20, l21, l22;
    Eigen::Vector3d gradient;
    bool is_valid;
  };

  void Load(const BundleProblem& problem, const optim::BundleGauge& gauge);
  // The cost of a state; also leaves chi2 of every observation in `chi2_`.
  double Cost(const CameraModel& camera, const State& state);
  // The cost of a state, and the reduced system of its linearisation damped by `lambda`.
  double Linearise(const CameraModel& camera, const State& state, double lambda);
  // Solves what Linearise left and writes the moved state to `candidate`. False when the system is not positive
  // definite.
  bool Step(const State& state, State* candidate);
  // Up to `max_steps` steps from `state_`, which ends as the best state found.
  void Minimise(const CameraModel& camera, const BundleOptions& options, int max_steps, BundleSummary* summary);
  void DropOutliers(double chi2_gate);
  void Store(BundleProblem* problem) const;

  double* Block(std::int32_t row, std::int32_t column) {
    return blocks_.data() + 36 * (static_cast<std::size_t>(row) * (row + 1) / 2 + column);
  }

  double threshold_ = 0.0;                 // of Huber's loss
  std::vector<Observation> observations_;  // grouped by point
  std::vector<Point> points_;              // those with observations
  std::vector<std::int32_t> free_poses_;   // pose index of each free pose
  State state_;
  State candidate_;
  std::vector<double> chi2_;            // of each observation, at the last state that Cost or Linearise saw
  std::vector<Matrix63> eliminated_y_;  // W L^-T of each observation of a free pose
  std::vector<Eliminated> eliminated_;  // of each point
  std::vector<double> blocks_;          // lower block triangle of the reduced system, 6x6 column-major blocks by rows
  std::vector<Vector6> pose_diagonal_;  // of the undamped pose blocks
  Eigen::VectorXd gradient_;            // reduced
  Eigen::MatrixXd dense_;
  Eigen::VectorXd step_;
  optim::ObservationsByPoint grouped_;
};

// One call with memory of its own.
Result<BundleSummary> AdjustBundleSchur(const CameraModel& camera, const BundleOptions& options,
                                        BundleProblem* problem);

}  // namespace haustra
