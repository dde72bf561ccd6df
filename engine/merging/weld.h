// Bundle adjustment over a seam: the keyframes on both sides of a merge or loop and all points they see move, a ring of
// older keyframes around them holds the gauge, or the reference side where that is too small (bundle_window.h).
// thread-bound(mapping); allocates, bounded by the sizes of windows and ring.
#pragma once

#include <functional>
#include <span>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/merging/bundle_window.h"
#include "engine/merging/merging_config.h"
#include "engine/noise_model.h"

namespace haustra {

class Weld {
 public:
  // Everything named outlives it; the adjuster may have other users between calls.
  Weld(const EngineConfig& config, const MergingConfig& options, const NoiseModel& noise, const CameraModel& camera,
       SchurBundleAdjuster& adjuster);

  struct Sides {
    std::span<const KeyframeHandle> moving;     // came over the seam
    std::span<const KeyframeHandle> reference;  // what they are welded to; may overlap with `moving`
    // Which keyframes outside may hold the gauge.
    std::function<bool(KeyframeHandle)> may_hold;
  };

  // As BundleWindow::Adjust.
  Result<BundleSummary> Adjust(const Sides& sides, Atlas* atlas, const Clock* clock, TimePoint deadline);

  // Of the last Adjust: keyframes and points that moved, and by what factor the moving side grew.
  std::span<const KeyframeHandle> keyframes() const { return window_.moving(); }
  int num_points() const { return window_.num_points(); }
  double moving_scale() const { return moving_scale_; }

 private:
  double MedianDistance(std::size_t num_moving) const;

  const MergingConfig& options_;
  BundleWindow window_;
  double moving_scale_ = 1.0;
};

}  // namespace haustra
