// One adjustment of many short reconstructions and the intrinsics that they share: Levenberg-Marquardt in which each
// window eliminates its points and its views, so that windows meet only in five unknowns. What is left of each window
// is its information on the intrinsics (matrix and gradient), from which the spread over windows follows.
// Triggs et al. 2000, "Bundle adjustment - a modern synthesis"; Cauchy's loss.
// reentrant, deterministic to the bit on one machine. Allocates. Not Ceres: it does not give the matrix of a window.
#pragma once

#include <vector>

#include "engine/calibration/intrinsics.h"
#include "engine/calibration/reconstruction.h"

namespace haustra::calibration {

// Gaussian knowledge of the intrinsics before the clip is looked at.
struct IntrinsicPrior {
  Intrinsics mean;        // k2 unused
  IntrinsicVector sigma;  // k2: about the curve of k2_per_k1_squared
  // The projections between orthographic and gnomonic have k2 near 0.3 to 1.2 times k1^2.
  double k2_per_k1_squared = 0.8;

  double Cost(const Intrinsics& at) const;
  void AddTo(const Intrinsics& at, IntrinsicMatrix* information, IntrinsicVector* gradient) const;
};

struct AdjustedWindow {
  Reconstruction reconstruction;
  double weight = 1.0;         // of the whole window, 0 and up; 0: it has no say in the intrinsics
  double noise_px = 1.0;       // of a feature of sigma 1, in this window
  double strain_sigma = 0.01;  // of each component in each view: how much the scene moves in itself
  // Of the last adjustment, with its weight: what is left of the window after its views and points are eliminated.
  IntrinsicMatrix information = IntrinsicMatrix::Zero();
  IntrinsicVector gradient = IntrinsicVector::Zero();
  // Mean square of the strains, their uncertainty included: what strain_sigma should have been (one step of EM).
  double mean_square_strain = 0.0;
};

struct AdjustmentOptions {
  int max_iterations = 40;  // 1 and up
  double loss_width = 2.0;  // of Cauchy's loss, in units of the noise
};

struct AdjustmentSummary {
  int iterations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
  bool is_usable = false;
};

AdjustmentSummary AdjustJointly(const IntrinsicPrior& prior, const AdjustmentOptions& options, Intrinsics* intrinsics,
                                std::vector<AdjustedWindow>* windows);

// Noise of a window from the median of its residuals, pixels at sigma 1.
double NoiseOf(const Intrinsics& intrinsics, const Reconstruction& reconstruction);

}  // namespace haustra::calibration
