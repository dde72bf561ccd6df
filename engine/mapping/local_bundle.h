// Local bundle adjustment: a keyframe, covisible ones and all their points move; other keyframes that see those points
// hold the gauge, or the oldest of them where there are none (engine/merging/bundle_window.h). thread-bound(mapping).
#pragma once

#include <functional>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/merging/bundle_window.h"
#include "engine/noise_model.h"

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

  const EngineConfig& config_;
  BundleWindow window_;
  std::vector<Covisible> covisible_;
};

}  // namespace haustra
