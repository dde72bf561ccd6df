// The features of one frame as the host needs them: keypoints and unit bearings; the descriptors stay on the device, in
// the feature set. Fixed capacity, taken at construction. The owner of the struct owns the feature set.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "hal/vision_device.h"

namespace haustra {

using Bearing = std::array<float, 3>;

inline Eigen::Vector3d ToVector(const Bearing& b) { return Eigen::Vector3d(b[0], b[1], b[2]); }

struct FrameFeatures {
  FrameFeatures() = default;
  explicit FrameFeatures(int max_features) : keypoints(max_features), bearings(max_features) {}

  FeatureSetHandle set;
  std::int32_t num = 0;
  std::vector<Keypoint> keypoints;  // [0, num)
  std::vector<Bearing> bearings;    // [0, num), camera coordinates

  Eigen::Vector2d pixel(int i) const { return {keypoints[i].x_px, keypoints[i].y_px}; }
  Eigen::Vector3d bearing(int i) const { return ToVector(bearings[i]); }
};

}  // namespace haustra
