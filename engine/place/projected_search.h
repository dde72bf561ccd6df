// Guided search of map points in a view whose pose is known only through a similarity (or is a guess): what should be
// visible is projected and searched there with the radius of the noise model and at the predicted size.
// thread-bound(mapping or merging, whoever has it).
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

struct FoundPoint {
  std::int32_t point_idx = -1;  // in the list that was searched
  std::int32_t feature_idx = -1;
  float similarity = 0.0f;
};

// What of a map point is needed to find it in a view.
struct SearchedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double scale_times_distance = 0.0;
  DescriptorRef descriptor;
};
inline SearchedPoint AsSearched(const MapPoint& point) {
  return {point.position, point.normal, point.scale_times_distance, point.descriptor};
}

struct SearchedView {
  FeatureSetHandle set;
  SE3 cam_from_view_map;
  // One a feature; those with a zero are left out. Empty: all features.
  std::span<const std::uint8_t> allowed;
};

class ProjectedSearch {
 public:
  ProjectedSearch(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device);

  // `view_map_from_map` takes the points' map into that of the view. Replaces `found` (at most one entry a point and a
  // feature). `num_visible`: points that should be seen in the view. Points beyond the longest list that the device
  // takes are not searched. Errors are those of the device.
  Status Search(std::span<const SearchedPoint> points, const Sim3& view_map_from_map, const SearchedView& view,
                std::vector<FoundPoint>* found, int* num_visible);

 private:
  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  VisionDevice& device_;
  std::vector<GuidedQuery> queries_;
  std::vector<std::int32_t> query_points_;
  std::vector<Match> matches_;
};

// The points that the keyframes show, each once, in order of keyframe and feature. Replaces `out`.
class PointCollector {
 public:
  explicit PointCollector(int max_map_points) : is_listed_(static_cast<std::size_t>(max_map_points), 0) {}
  void Collect(const Atlas& atlas, std::span<const KeyframeHandle> keyframes, std::vector<MapPointHandle>* out);

 private:
  std::vector<std::uint8_t> is_listed_;  // by point slot
};

// The keyframe and its best covisible ones, at most `max_keyframes` in all. Replaces `out`; `covisible` is a workspace.
void CollectGroup(const Atlas& atlas, KeyframeHandle keyframe, int max_keyframes, int min_shared,
                  std::vector<Covisible>* covisible, std::vector<KeyframeHandle>* out);

}  // namespace haustra
