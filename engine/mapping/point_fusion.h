// Joins what is one point: map points projected into a keyframe and searched there (guided). A feature without a point
// gains the observation; one that already shows another point means that the two are the same, and they are fused.
// thread-bound(mapping).
#pragma once

#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/noise_model.h"
#include "hal/vision_device.h"

namespace haustra {

class PointFuser {
 public:
  PointFuser(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device);

  // Searches `candidates` (stale handles are skipped) in the keyframe. Returns the number of observations gained plus
  // points fused.
  int SearchInto(KeyframeHandle handle, std::span<const MapPointHandle> candidates, Atlas* atlas);

 private:
  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  VisionDevice& device_;
  std::vector<GuidedQuery> queries_;
  std::vector<MapPointHandle> query_points_;
  std::vector<Match> matches_;
};

}  // namespace haustra
