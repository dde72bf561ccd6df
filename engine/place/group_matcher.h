// Brute-force matches between a keyframe and a group of keyframes on the other side, of features that show map points.
// thread-bound(merging), deterministic.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/config.h"
#include "engine/place/place_config.h"
#include "engine/place/place_excerpt.h"
#include "hal/vision_device.h"

namespace haustra {

struct GroupMatch {
  std::int32_t feature_a = -1;
  int view_b = 0;  // keyframe of the group
  std::int32_t feature_b = -1;
  float similarity = 0.0f;
};

class GroupMatcher {
 public:
  // Everything named outlives it.
  GroupMatcher(const EngineConfig& config, const CommonAreaConfig& options, VisionDevice& device);

  // Replaces `out`, in order of the group's keyframes. Errors are those of the device.
  Status Compare(const KeyframeExcerpt& a, const GroupExcerpt& b, std::vector<GroupMatch>* out);

 private:
  const EngineConfig& config_;
  const CommonAreaConfig& options_;
  VisionDevice& device_;
  std::vector<std::int32_t> features_a_;
  std::vector<std::int32_t> features_b_;
  std::vector<Match> found_;
};

}  // namespace haustra
