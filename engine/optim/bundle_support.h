// What the bundle adjusters of this folder share: the cost they minimise, the checks of their input, the gauge and the
// final verdict on the observations. Private to engine/optim and its tests.
#pragma once

#include <cmath>
#include <vector>

#include "engine/optim/bundle_adjustment.h"

namespace haustra::optim {

// A point that the camera cannot see (behind it, beyond the model) has no residual that could be differentiated. It
// counts as an observation this many Huber thresholds off: worse than any inlier, so that a step does not gain by
// moving points behind the camera, but bounded, so that one such point cannot veto a step that is good for all others.
inline constexpr double kUnseenThresholds = 10.0;

// A step that lowers the cost by less than this share ends a phase. In a window of 10000 observations that is about one
// unit of chi2, far below what noise does to the cost.
inline constexpr double kMinRelativeDecrease = 1e-4;

// Huber's loss of a squared residual in units of sigma; `threshold` = sqrt(gate).
inline double HuberLoss(double chi2, double threshold) {
  return chi2 <= threshold * threshold ? chi2 : 2.0 * threshold * std::sqrt(chi2) - threshold * threshold;
}

// kInvalidArgument with the index and the value that is wrong.
Status ValidateBundle(const BundleOptions& options, const BundleProblem& problem);

// Observations grouped by point, in the order of the point indices; within a point in the order of the input.
struct ObservationsByPoint {
  std::vector<std::int32_t> order;  // observation indices
  std::vector<std::int32_t> begin;  // num_points + 1 offsets into `order`
};
void GroupByPoint(const BundleProblem& problem, ObservationsByPoint* grouped);

// What stays where it is during one call (see AdjustBundle about the gauge).
struct BundleGauge {
  std::int32_t held_pose = -1;    // a pose held although it is not fixed, or -1
  std::int32_t anchor_pose = -1;  // when >= 0: the scale is free, and is set about this camera by the distances below
  std::vector<double> distances;  // with an anchor: from camera to point at the start, of every observation
  bool has_free_parameter = false;
};
BundleGauge ChooseGauge(const BundleProblem& problem);
// Scales free poses and points that are observed about the centre of the anchor, so that the distances from cameras to
// points are what they were, in the median of their ratios. Leaves all residuals as they are.
void RestoreScale(const BundleGauge& gauge, BundleProblem* problem);

struct BundleVerdict {
  double cost = 0.0;  // as BundleSummary::initial_cost
  int num_outliers = 0;
};
// Sets is_outlier of every observation: to its verdict when the solver has converged, to false otherwise.
BundleVerdict ClassifyObservations(const CameraModel& camera, double chi2_gate, SolveState state,
                                   BundleProblem* problem);

}  // namespace haustra::optim
