#include "engine/mapping/point_fusion.h"

#include "engine/geometry/constants.h"

#include <algorithm>
#include <cmath>

namespace haustra {
namespace {}  // namespace

PointFuser::PointFuser(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                       VisionDevice& device)
    : config_(config), noise_(noise), camera_(camera), device_(device) {}

int PointFuser::SearchInto(KeyframeHandle handle, std::span<const MapPointHandle> candidates, Atlas* atlas) {
  queries_.clear();
  query_points_.clear();
  const Keyframe& keyframe = atlas->keyframe(handle);
  const Eigen::Vector3d centre = keyframe.cam_from_map.InverseTranslation();
  const double min_cos = std::cos(config_.matching.max_view_angle_deg * kDegree);
  const double tolerance = config_.matching.scale_tolerance;
  const double gate = std::sqrt(kChi2TwoDof);
  const std::size_t max_queries = static_cast<std::size_t>(device_.plan().max_match_list);
  for (const MapPointHandle candidate : candidates) {
    const MapPoint* point = atlas->GetPoint(candidate);
    if (point == nullptr || queries_.size() == max_queries) continue;
    const Eigen::Vector3d to_camera = centre - point->position;
    const double distance = to_camera.norm();
    if (distance <= 0.0 || point->normal.dot(to_camera) < min_cos * distance) continue;
    Eigen::Vector2d pixel;
    if (!camera_.Project(keyframe.cam_from_map * point->position, &pixel) || !camera_.IsInImage(pixel)) continue;
    if (atlas->FeatureOf(*point, handle) >= 0) continue;
    const double scale = point->scale_times_distance / distance;
    queries_.push_back({point->descriptor, static_cast<float>(pixel.x()), static_cast<float>(pixel.y()),
                        static_cast<float>(gate * noise_.SigmaPx(scale)), static_cast<float>(scale / tolerance),
                        static_cast<float>(scale * tolerance)});
    query_points_.push_back(candidate);
  }
  if (queries_.empty()) return 0;
  matches_.resize(queries_.size());
  std::int32_t num_matches = 0;
  GuidedMatchRequest request;
  request.queries = queries_;
  request.train = keyframe.features.set;
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.matching.guided_ratio), false};
  request.matches = matches_;
  request.num_matches = &num_matches;
  if (!GuidedMatchAndWait(device_, Lane::kBackground, request).ok()) return 0;

  int joined = 0;
  for (int m = 0; m < num_matches; ++m) {
    const MapPointHandle handle_a = query_points_[matches_[m].query];
    const int feature = matches_[m].train;
    const MapPoint* a = atlas->GetPoint(handle_a);
    if (a == nullptr) continue;  // fused away by an earlier match
    const MapPointHandle handle_b = keyframe.points[feature];
    if (!handle_b) {
      if (atlas->AddObservation(handle_a, handle, feature)) {
        atlas->UpdatePoint(handle_a);
        ++joined;
      }
      continue;
    }
    if (handle_b == handle_a) continue;
    const bool keep_b = atlas->point(handle_b).observations.size() >= a->observations.size();
    atlas->FusePoints(keep_b ? handle_a : handle_b, keep_b ? handle_b : handle_a);
    ++joined;
  }
  return joined;
}

}  // namespace haustra
