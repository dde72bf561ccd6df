// Intrinsics of a camera from windows of a clip of its own: each window is reconstructed by itself, then one adjustment
// takes all of them with the intrinsics that they share; how far the windows agree says how far to trust the result.
// Refuses when there are too few windows, or when they do not hold the focal length. Then it still guesses: what the
// clip says, weighed by how far its parts agree, together with what is usual for a scope. reentrant. Allocates. Repeats
// to the bit for the same input on one machine.
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
  // What is usual before the clip is looked at. None of it is narrow enough to pass max_focal_spread by itself.
  double centre_sigma = 0.01;     // share of the window's width
  double focal_per_width = 0.62;  // of a picture that is filled to its corners, which may be a part of the window
  double log_focal_sigma = 0.4;
  double k1 = 0.0;
  // Of a window that is seen whole (ScopeWindow::is_cut). At 70 to 85 degrees to the axis r = f (th - 0.14 th^3) is
  // 0.97 to 1.03 f: the half diagonal of the window is the focal length of any colonoscope of 140 to 170 degrees. That
  // is 0.50 to 0.57 of the width for those of config/cameras; a laparoscope of 60 to 90 degrees has 0.5 to 0.87.
  double cut_focal_per_width = 0.55;
  double cut_log_focal_sigma = 0.15;
  double cut_k1 = -0.1;
  double k1_sigma = 0.2;
  double k2_sigma = 0.015;
};

struct Residual {
  Eigen::Vector2d pixel;  // where the point was seen
  Eigen::Vector2d error;  // reprojected minus seen, px
};

struct CalibrationEstimate {
  // Ok: the clip holds the intrinsics. kFailedPrecondition: refused, what the clip lacks; the intrinsics are a guess.
  Status verdict;
  Intrinsics intrinsics;
  // Standard deviations, from the spread over windows and from the noise, the larger; of a guess with what is usual.
  IntrinsicVector sigma = IntrinsicVector::Zero();
  int num_windows = 0;  // that had a say
  int num_windows_offered = 0;
  int num_points = 0;
  double rms_px = 0.0;
  double coverage = 0.0;  // share of the cells of a 10 by 10 grid on the window that hold ten observations
  std::vector<Residual> residuals;
};

CalibrationEstimate EstimateIntrinsics(std::span<const FeatureWindow> windows, const ScopeWindow& scope,
                                       const SelfCalibrationOptions& options);

// What is usual for a scope with this window, where the clip says nothing: why, kFailedPrecondition.
CalibrationEstimate UsualIntrinsics(const ScopeWindow& scope, const SelfCalibrationOptions& options, Status why);

}  // namespace haustra::calibration
