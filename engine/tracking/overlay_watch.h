// Shows the running map's frames to a StaticOverlay and takes out of every frame what it has found. The map says how
// the scene moves: its points, projected from the pose of an earlier frame and found in this one. What has a twin at
// the same place of the earlier frame stood still meanwhile. No request to the device.
// thread-bound(tracking); rt-safe, memory taken at construction.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/atlas/frame_features.h"
#include "engine/config.h"
#include "engine/tracking/static_overlay.h"
#include "hal/core/time.h"

namespace haustra {

class OverlayWatch {
 public:
  // A feature of this frame that shows a point of the map, and where the pose of the earlier frame puts that point.
  struct Tracked {
    std::int32_t feature_idx = -1;
    Eigen::Vector2f before_px = Eigen::Vector2f::Zero();
  };

  OverlayWatch(const InitialisationConfig& noise, bool is_on, int width_px, int height_px, int max_features);
  static std::size_t BytesFor(int max_features);

  // Takes what stands still out of a new frame: its bearings become zero, which agrees with no geometry.
  void Blank(FrameFeatures* features) const;
  // Features that may show the scene: 1, the others 0.
  void Allow(const FrameFeatures& features, std::span<std::uint8_t> allowed) const;

  // Matches of two views, without a map. Leaves out those that stand still and
  // returns how many are left, in their order.
  int Sift(const FrameFeatures& before, const FrameFeatures& now, std::span<Match> matches, TimePoint before_time,
           TimePoint time);

  // The frame that later ones are compared with: kept until one has been, or until it is too old.
  bool is_due(TimePoint time) const;
  bool has_frame() const { return num_before_ > 0; }
  void KeepFrame(const FrameFeatures& features, TimePoint time);
  // This frame against the kept one; the points that the map tracks in it.
  void Compare(const FrameFeatures& now, std::span<const Tracked> tracked, TimePoint time);

  const StaticOverlay& overlay() const { return overlay_; }

 private:
  // What has not been observed yet of the time between two views.
  double SecondsSinceLast(TimePoint before, TimePoint time);
  float Sigma(const Keypoint& keypoint) const;

  const InitialisationConfig& noise_;
  const bool is_on_;
  StaticOverlay overlay_;
  TimePoint last_time_;
  bool has_last_time_ = false;
  std::vector<Keypoint> before_;
  int num_before_ = 0;
  TimePoint before_time_;
  std::vector<std::int32_t> twins_;
  std::vector<StaticOverlay::Motion> motions_;
  std::vector<std::uint8_t> stands_still_;
};

}  // namespace haustra
