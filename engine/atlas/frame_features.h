// The features of one frame as the host needs them: keypoints and unit bearings; the descriptors stay on the device, in
// the feature set. Fixed capacity, taken at construction. The owner of the struct owns the feature set.
#pragma once

#include <algorithm>
#include <array>
#include <memory_resource>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "hal/core/memory_arena.h"
#include "hal/vision_device.h"

namespace haustra {

using Bearing = std::array<float, 3>;

inline Eigen::Vector3d ToVector(const Bearing& b) { return Eigen::Vector3d(b[0], b[1], b[2]); }

struct FrameFeatures {
  FrameFeatures() = default;
  explicit FrameFeatures(int max_features, std::pmr::memory_resource* memory = std::pmr::get_default_resource())
      : keypoints(max_features, memory), bearings(max_features, memory) {}
  // What one takes from its arena.
  static std::size_t BytesFor(int max_features) {
    return MemoryArena::BytesFor<Keypoint>(max_features) + MemoryArena::BytesFor<Bearing>(max_features);
  }

  FeatureSetHandle set;
  std::int32_t num = 0;
  std::int32_t num_followed = 0;         // of these, the last ones: known from the last frame, not detected in this one
  bool is_reduced = false;               // the extractor was asked for fewer and coarser ones, for want of time
  std::pmr::vector<Keypoint> keypoints;  // [0, num)
  std::pmr::vector<Bearing> bearings;    // [0, num), camera coordinates

  bool is_detected(int i) const { return i < num - num_followed; }
  Eigen::Vector2d pixel(int i) const { return {keypoints[i].x_px, keypoints[i].y_px}; }
  Eigen::Vector3d bearing(int i) const { return ToVector(bearings[i]); }
  // Overlays, and what the camera model does not reach, have none: a bearing of zero agrees with every motion.
  bool has_bearing(int i) const { return bearings[i] != Bearing{}; }
};

// Leaves out the matches of features without a bearing (query: of a, train: of b). Returns how many are left, in their
// order.
inline int DropWithoutBearing(const FrameFeatures& a, const FrameFeatures& b, std::span<Match> matches) {
  const auto has_none = [&](const Match& match) { return !a.has_bearing(match.query) || !b.has_bearing(match.train); };
  return static_cast<int>(std::remove_if(matches.begin(), matches.end(), has_none) - matches.begin());
}

}  // namespace haustra
