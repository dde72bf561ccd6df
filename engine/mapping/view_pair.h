// Two keyframes matched by appearance alone, as the geometry of two views wants it: whatever the map says of them has
// no part in it. thread-bound(mapping).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/noise_model.h"
#include "hal/vision_device.h"

namespace haustra {

class ViewPair {
 public:
  // Everything named outlives it. Holds at most features.max matches.
  ViewPair(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device);

  // Brute force on the background lane; false when the device fails. Features without a bearing are left out.
  bool Compare(const Keyframe& a, const Keyframe& b);

  // Of the last Compare, entry by entry: query is a feature of a, train one of b; bearings in the two cameras; the
  // joint turn of both up to which they agree, 95 % of true matches.
  std::span<const Match> matches() const { return {matches_.data(), bearings_a_.size()}; }
  std::span<const Eigen::Vector3d> bearings_a() const { return bearings_a_; }
  std::span<const Eigen::Vector3d> bearings_b() const { return bearings_b_; }
  std::span<const double> tolerance_rad() const { return tolerance_rad_; }

 private:
  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  VisionDevice& device_;
  std::vector<Match> matches_;
  std::vector<Eigen::Vector3d> bearings_a_;
  std::vector<Eigen::Vector3d> bearings_b_;
  std::vector<double> tolerance_rad_;
};

}  // namespace haustra
