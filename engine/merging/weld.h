// Bundle adjustment over a seam: the keyframes on both sides of a merge or loop and all points they see move, a ring of
// older keyframes around them holds the gauge. Observations that do not fit afterwards are taken out.
// thread-bound(mapping); allocates, bounded by the sizes of windows and ring.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/merging/merging_config.h"
#include "engine/noise_model.h"
#include "engine/optim/schur_bundle_adjustment.h"

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

  // Writes back what was gained, and takes out the observations that do not fit when it has converged. kNone: the atlas
  // is as it was.
  Result<BundleSummary> Adjust(const Sides& sides, Atlas* atlas, const Clock* clock, TimePoint deadline);

  // Of the last Adjust: keyframes and points that moved, and by what factor the moving side grew.
  std::span<const KeyframeHandle> keyframes() const { return {poses_.data(), num_free_}; }
  int num_points() const { return static_cast<int>(points_.size()); }
  double moving_scale() const { return moving_scale_; }

 private:
  void ChooseKeyframes(const Sides& sides, const Atlas& atlas);
  void FillProblem(const Sides& sides, const Atlas& atlas);
  void WriteBack(Atlas* atlas);
  double MedianDistance(std::size_t num_moving) const;

  const EngineConfig& config_;
  const NoiseModel& noise_;
  const MergingConfig& options_;
  const CameraModel& camera_;
  SchurBundleAdjuster& adjuster_;
  BundleProblem problem_;
  std::vector<KeyframeHandle> poses_;  // of problem_.poses: moving side, reference side, ring
  std::size_t num_free_ = 0;           // of both sides
  std::vector<MapPointHandle> points_;
  double moving_scale_ = 1.0;
  std::vector<std::int32_t> pose_slots_;   // by keyframe slot: index in poses_, -1
  std::vector<std::int32_t> point_slots_;  // by point slot: index in points_, -1
  std::vector<int> ring_votes_;            // by keyframe slot
};

}  // namespace haustra
