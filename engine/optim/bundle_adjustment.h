// Bundle adjustment: camera poses and points that make the reprojection errors of a set of observations least, in the
// sense of Huber's loss on chi-square. Plain data in, plain data out. AdjustBundle solves with Ceres, which stays
// inside engine/optim; the mapper uses it for the views that found a map, and for windows and seams the one of
// schur_bundle_adjustment.h.
// Triggs et al. 2000, "Bundle adjustment - a modern synthesis"; Huber 1964.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/optim/solve_state.h"
#include "hal/clock.h"
#include "hal/core/status.h"
#include "hal/core/time.h"

namespace haustra {

struct BundlePose {
  SE3 cam_from_world;
  bool is_fixed = false;
};

struct BundlePoint {
  Eigen::Vector3d position;  // world frame, map units
  bool is_fixed = false;
};

struct BundleObservation {
  std::int32_t pose_idx = 0;
  std::int32_t point_idx = 0;
  Eigen::Vector2d pixel;
  double sigma_px = 1.0;    // > 0
  bool is_outlier = false;  // out: chi2 above the gate, or the camera cannot see the point (behind it)
};

// Owned by the caller and reused between calls, so that its capacity is kept. Poses and points without observations
// are left alone. At most one observation for each pair of pose and point is expected; more are allowed and count.
struct BundleProblem {
  std::vector<BundlePose> poses;
  std::vector<BundlePoint> points;
  std::vector<BundleObservation> observations;
};

struct BundleOptions {
  int max_iterations = 10;  // >= 1, steps of the solver, rejected ones included
  double chi2_gate =
      5.991;  // > 0; outlier above it, and the square of Huber's threshold. 95 % for two degrees of freedom
  // Half the iterations on everything, then without what fails the gate. Otherwise all iterations on everything.
  bool reject_outliers_midway = true;
  std::function<bool()> should_stop;  // asked before every iteration; empty: never
  TimePoint deadline = kNoDeadline;   // stop, too, when `clock` reaches it
  const Clock* clock = nullptr;       // needed only with a deadline
};

struct BundleSummary {
  int iterations = 0;
  double initial_cost = 0.0;  // half the sum of Huber's loss of chi2 over all observations; an unseen point counts
  double final_cost = 0.0;    //   as one 10 thresholds off
  int num_outliers = 0;       // observations with is_outlier set on return
  SolveState state = SolveState::kNone;
};

// Adjusts every pose and point of `problem` that is not fixed. kConverged: the cost falls no more, or all iterations
// are made. kPartial: the best state until `should_stop` or `deadline` stopped it. kNone: poses and points are as they
// were. is_outlier of an observation is its verdict only after kConverged (also for those that were dropped midway and
// fit again). Otherwise it is false for all: a state that is not final cannot say which observations are wrong.
//
// Gauge. Fixed poses are bit-for-bit unchanged. When none is fixed, the first pose that has observations is held for
// the call. When just one pose is held and no fixed point is observed, nothing measures the scale: the result is then
// scaled about the centre of the held camera so that the ratio of distances after to before, from cameras to the points
// they observe, is 1 in the median. No single camera or point decides about the unit.
//
// Deterministic to the bit for the same input on one machine when nothing stops it: one thread, parameters in the order
// of their indices. Allocates (Ceres); never call it on the tracking thread. reentrant.
// Cost: about 12 ms an iteration for 20 poses, 4000 points and 24000 observations on a server core (engine/optim/
// benchmarks); a call asks `should_stop` and `deadline` once an iteration.
// Errors: kInvalidArgument (options; an index, pixel, sigma, pose or point that is out of range or not finite; a
// deadline without a clock), kInternal (the solver ran out of memory). On error poses and points are untouched.
// Nothing to adjust (no observation of a free pose or point) is no error: the state is kNone.
Result<BundleSummary> AdjustBundle(const CameraModel& camera, const BundleOptions& options, BundleProblem* problem);

}  // namespace haustra
