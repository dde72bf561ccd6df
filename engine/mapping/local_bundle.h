// Local bundle adjustment: a keyframe, covisible ones and all their points move; other keyframes that see those points
// hold the gauge. Writes back what was gained. Takes out the observations that do not fit when it was finished: on the
// word of a bundle that was stopped none goes.
// thread-bound(mapping).
#pragma once

#include <functional>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/noise_model.h"
#include "engine/optim/schur_bundle_adjustment.h"

namespace haustra {

class LocalBundle {
 public:
  // Everything named outlives it; the adjuster may have other users between calls.
  LocalBundle(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
              SchurBundleAdjuster& adjuster);

  struct Extent {
    int max_keyframes = 1;    // that move
    bool is_direct = true;    // only those covisible with the centre; otherwise theirs as well, and so on
    int max_iterations = 10;  // of the solver
  };

  // When it stops before all iterations are made. Default: never (sequential mode).
  struct Limits {
    const Clock* clock = nullptr;  // needed with a deadline
    TimePoint deadline = kNoDeadline;
    std::function<bool()> should_stop;  // asked before every iteration
  };

  Result<BundleSummary> Adjust(KeyframeHandle centre, const Extent& extent, const Limits& limits, Atlas* atlas);

 private:
  void ChooseWindow(KeyframeHandle centre, const Extent& extent, const Atlas& atlas);
  void ReserveObservations(const Atlas& atlas);
  void FillProblem(const Atlas& atlas);
  void WriteBack(Atlas* atlas);

  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  SchurBundleAdjuster& adjuster_;
  BundleProblem problem_;
  std::vector<KeyframeHandle> poses_;  // of problem_.poses: the window, then the fixed ring
  std::size_t window_size_ = 0;
  std::vector<MapPointHandle> points_;  // of problem_.points
  std::vector<Covisible> covisible_;
  std::vector<std::int32_t> pose_slots_;   // by keyframe slot: index in poses_, -1
  std::vector<std::int32_t> point_slots_;  // by point slot: index in points_, -1
  std::vector<int> ring_votes_;            // by keyframe slot: window points that it sees
};

}  // namespace haustra
