// Intrinsics of a camera from windows of a clip of its own: each window is reconstructed by itself, then one adjustment
// takes all of them with the intrinsics that they share; how far the windows agree says how far to trust the result.
// Refuses when there are too few windows, or when they do not hold the focal length.
// reentrant. Allocates. Repeats to the bit for the same input on one machine.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/calibration/feature_window.h"
#include "engine/calibration/intrinsics.h"
#include "engine/calibration/joint_adjustment.h"
#include "engine/calibration/scope_window.h"
#include "hal/core/status.h"

namespace haustra::calibration {

struct SelfCalibrationOptions {
  std::uint64_t seed = 1;
  int min_windows = 6;              // with a say; fewer: refused
  int max_windows = 60;             // those with most observations
  double max_focal_spread = 0.025;  // standard deviation of the log of the focal length; more: refused
  double centre_sigma = 0.02;       // prior, share of the window's width
  double focal_per_width = 0.62;    // prior: an angle of view of 93 degrees across the window
  double log_focal_sigma = 0.4;
  double k1_sigma = 0.2;
  double k2_sigma = 0.015;
};

struct Residual {
  Eigen::Vector2d pixel;  // where the point was seen
  Eigen::Vector2d error;  // reprojected minus seen, px
};

struct CalibrationEstimate {
  Intrinsics intrinsics;
  // Standard deviations, from the spread over windows and from the noise, the larger.
  IntrinsicVector sigma = IntrinsicVector::Zero();
  int num_windows = 0;  // that had a say
  int num_windows_offered = 0;
  int num_points = 0;
  double rms_px = 0.0;
  double coverage = 0.0;  // share of the cells of a 10 by 10 grid on the window that hold ten observations
  std::vector<Residual> residuals;
};

// kFailedPrecondition: refused; the message says what the clip lacks.
Result<CalibrationEstimate> EstimateIntrinsics(std::span<const FeatureWindow> windows, const ScopeWindow& scope,
                                               const SelfCalibrationOptions& options);

}  // namespace haustra::calibration
