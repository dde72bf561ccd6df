// Pose of one camera from map points that stay fixed: Levenberg-Marquardt over six degrees of freedom on the left
// perturbation (rho, phi) of cam_from_world, reprojection error divided by each observation's sigma, analytic
// Jacobians. Early rounds see all observations through a robust cost that levels off (small_least_squares.h says why
// not Huber), with a scale that follows how far off the start was; after each round every observation is classified
// anew by chi-square, so that one which was thrown out comes back when the pose has improved; the last rounds fit the
// inliers alone. Fixed size, no heap; the same result for the same input to the bit on one instruction set
// (vector_level.h). reentrant, rt-safe.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"

namespace haustra {

struct PoseObservation {
  Eigen::Vector3d point_in_world;  // map units
  Eigen::Vector2d pixel;
  double sigma_px;  // > 0, of each coordinate
};

struct PoseOptimizerOptions {
  int rounds = 4;                // 1 and up; the first half (at least one) is robust
  int iterations_per_round = 8;  // 1 and up
  double chi2_gate = 5.991;      // 95 % of two degrees of freedom
};

struct PoseOptimizerResult {
  SE3 cam_from_world;
  int num_inliers = 0;
  double mean_chi2 = 0.0;                   // of the inliers; 2 less a little when the sigmas are right
  Matrix6d information = Matrix6d::Zero();  // J' W J of the inliers at the result, order (rho, phi)
  bool converged = false;                   // the last round ended by a small step, not by its count
};

// `inliers` has one entry an observation, written 1 or 0. False when fewer than 4 observations fit (the inliers are
// then those of the pose that was reached), the information is singular, the lengths differ, or the pose is not finite;
// the result then holds the initial pose and converged = false.
bool OptimizePose(const CameraModel& camera, std::span<const PoseObservation> observations,
                  const SE3& initial_cam_from_world, const PoseOptimizerOptions& options,
                  std::span<std::uint8_t> inliers, PoseOptimizerResult* result);

struct PoseUncertainty {
  double position_sigma = 0.0;  // of the camera, over the depth; infinite when the information is singular
  double rotation_sigma_deg = 0.0;
};
// What the information of a pose leaves open, seen from the camera; depth in map units, positive.
PoseUncertainty UncertaintyOf(const Matrix6d& information, double depth);

}  // namespace haustra
