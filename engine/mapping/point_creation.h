// New map points: the features of a keyframe that show no point yet are matched with its best covisible keyframes by
// brute force under the epipolar constraint, and triangulated when parallax, reprojection and scale agree.
// thread-bound(mapping).
#pragma once

#include <array>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/noise_model.h"
#include "hal/vision_device.h"

namespace haustra {

class PointCreator {
 public:
  PointCreator(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device);

  // Appends the points made to `created`.
  void Create(KeyframeHandle handle, std::span<const Covisible> neighbours, Atlas* atlas,
              std::vector<MapPointHandle>* created);

 private:
  void CreateWith(KeyframeHandle handle, KeyframeHandle neighbour, Atlas* atlas, std::vector<MapPointHandle>* created);
  bool IsConsistent(const Keyframe& a, int feature_a, const Keyframe& b, int feature_b,
                    const Eigen::Vector3d& in_map) const;

  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  VisionDevice& device_;
  std::vector<std::int32_t> unmatched_a_;
  std::vector<std::int32_t> unmatched_b_;
  std::vector<float> tolerance_a_;
  std::vector<float> tolerance_b_;
  std::vector<Match> matches_;
};

}  // namespace haustra
