// Similarity between two maps by reprojection in both directions: every point of map b is brought to map a and
// projected into the view that saw its partner there, and the reverse. Levenberg-Marquardt over seven degrees of
// freedom (rho, phi, log scale; left perturbation of b_from_a), in robust and plain rounds as in pose_optimizer.h.
// Poses and points stay fixed. reentrant, rt-safe (no heap), the same bits for the same input.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/geometry/sim3.h"
#include "engine/geometry/sim3_match.h"

namespace haustra {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

// exp of the step: scale by e^lambda, turn by phi, move by rho (not the group's exponential, which couples them; equal
// to it to first order, which is what an optimiser needs). tangent = (rho, phi, lambda).
Sim3 Sim3FromTangent(const Vector7d& tangent);

struct Sim3OptimizerOptions {
  int rounds = 4;                // 1 and up; the first half (at least one) is robust
  int iterations_per_round = 8;  // 1 and up
  double chi2_gate = 9.488;      // 95 % of four degrees of freedom: both directions of a match together
};

struct Sim3OptimizerResult {
  Sim3 b_from_a;
  int num_inliers = 0;
  double mean_chi2 = 0.0;                   // of the inliers, both directions together
  Matrix7d information = Matrix7d::Zero();  // J' W J of the inliers, order (rho, phi, lambda)
  bool converged = false;
};

// views_a[k] = cam_from_a, views_b[k] = cam_from_b; every match names one of each. `inliers` has one entry a match,
// written 1 or 0. False when fewer than 4 matches fit, a view index is out of range, the lengths differ, or the problem
// is singular; the result then holds the initial similarity and converged = false.
bool OptimizeSim3(const CameraModel& camera, std::span<const Sim3Match> matches, std::span<const SE3> views_a,
                  std::span<const SE3> views_b, const Sim3& initial_b_from_a, const Sim3OptimizerOptions& options,
                  std::span<std::uint8_t> inliers, Sim3OptimizerResult* result);

}  // namespace haustra
