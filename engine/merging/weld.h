// Bundle adjustment over a seam: the keyframes on both sides of a merge or loop and all points they see move, a ring of
// older keyframes around them holds the gauge, or the reference side where that is too small (bundle_window.h). Begin
// copies the seam, Solve works on the copy as often as it takes, WriteBack puts it back: between these keyframes and
// points may come and go, but none may be moved. A point that one keyframe of the weld alone sees goes along with it:
// one view says nothing of how far away it is, and those that say it are not welded.
// thread-bound(mapping); allocates, bounded by the sizes of windows and ring.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/sim3.h"
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

  void Begin(const Sides& sides, const Atlas& atlas);
  // Goes on until it is done, or is stopped: then it may be called again. `summary` is that of all calls since Begin;
  // its state stays kNone until something is gained. An error of the adjuster ends it with what was gained before.
  void Solve(const std::function<bool()>& should_stop);
  // The atlas stays as it is when nothing was gained. Observations are taken out only on the word of a bundle that was
  // finished.
  void WriteBack(Atlas* atlas);

  const BundleSummary& summary() const { return summary_; }
  // Of the last Begin: keyframes and points that move, those of the moving side first.
  std::span<const KeyframeHandle> keyframes() const { return window_.moving(); }
  std::span<const KeyframeHandle> moving_side() const { return keyframes().first(num_moving_); }
  int num_points() const { return window_.num_points(); }
  bool Has(KeyframeHandle keyframe) const { return window_.Has(keyframe); }
  bool Has(MapPointHandle point) const { return window_.Has(point); }
  // Since Begin: by what factor the moving side has grown, and what takes points at the i-th keyframe from where they
  // were to where they are when the unit around it has become `growth` times as large.
  double moving_scale() const { return moving_scale_; }
  Sim3 Correction(std::size_t i, double growth) const;

 private:
  // A point that one of keyframes() sees, and no other keyframe of the weld.
  struct SingleView {
    std::size_t point = 0;  // in the problem
    std::size_t keyframe = 0;
    Eigen::Vector3d position_before = Eigen::Vector3d::Zero();
  };

  void ListSingleViews();
  double MedianDistance() const;

  const MergingConfig& options_;
  BundleWindow window_;
  std::vector<SE3> poses_before_;  // of the keyframes that move
  std::vector<SingleView> single_views_;
  std::vector<int> num_views_;  // by point of the problem
  BundleSummary summary_;
  std::size_t num_moving_ = 0;
  double distance_before_ = 0.0;
  double moving_scale_ = 1.0;
};

}  // namespace haustra
