#include "engine/place/projected_search.h"

#include "engine/geometry/constants.h"

#include <cmath>

namespace haustra {

ProjectedSearch::ProjectedSearch(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                                 VisionDevice& device)
    : config_(config), noise_(noise), camera_(camera), device_(device) {}

Status ProjectedSearch::Search(std::span<const SearchedPoint> points, const Sim3& view_map_from_map,
                               const SearchedView& view, std::vector<FoundPoint>* found, int* num_visible) {
  found->clear();
  *num_visible = 0;
  queries_.clear();
  query_points_.clear();
  const Eigen::Vector3d centre = view.cam_from_view_map.InverseTranslation();
  const double min_cos = std::cos(config_.matching.max_view_angle_deg * kDegree);
  const double tolerance = config_.matching.scale_tolerance;
  const double gate = std::sqrt(kChi2TwoDof);
  const std::size_t max_queries = static_cast<std::size_t>(device_.plan().max_match_list);
  for (std::size_t i = 0; i < points.size() && queries_.size() < max_queries; ++i) {
    const SearchedPoint& point = points[i];
    const Eigen::Vector3d position = view_map_from_map * point.position;
    const Eigen::Vector3d to_camera = centre - position;
    const double distance = to_camera.norm();
    if (distance <= 0.0) continue;
    if ((view_map_from_map.rotation * point.normal).dot(to_camera) < min_cos * distance) continue;
    Eigen::Vector2d pixel;
    if (!camera_.Project(view.cam_from_view_map * position, &pixel) || !camera_.IsInImage(pixel)) continue;
    const double scale = view_map_from_map.scale * point.scale_times_distance / distance;
    queries_.push_back({point.descriptor, static_cast<float>(pixel.x()), static_cast<float>(pixel.y()),
                        static_cast<float>(gate * noise_.SigmaPx(scale)), static_cast<float>(scale / tolerance),
                        static_cast<float>(scale * tolerance)});
    query_points_.push_back(static_cast<std::int32_t>(i));
  }
  *num_visible = static_cast<int>(queries_.size());
  if (queries_.empty()) return Status::Ok();

  matches_.resize(queries_.size());
  std::int32_t num_matches = 0;
  GuidedMatchRequest request;
  request.queries = queries_;
  request.train = view.set;
  request.train_allowed = view.allowed;
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.matching.guided_ratio), false};
  request.matches = matches_;
  request.num_matches = &num_matches;
  HAUSTRA_TRY(GuidedMatchAndWait(device_, Lane::kBackground, request));
  for (std::int32_t m = 0; m < num_matches; ++m) {
    found->push_back({query_points_[matches_[m].query], matches_[m].train, matches_[m].similarity});
  }
  return Status::Ok();
}

void PointCollector::Collect(const Atlas& atlas, std::span<const KeyframeHandle> keyframes,
                             std::vector<MapPointHandle>* out) {
  out->clear();
  for (const KeyframeHandle handle : keyframes) {
    const Keyframe& keyframe = atlas.keyframe(handle);
    for (std::int32_t i = 0; i < keyframe.features.num; ++i) {
      const MapPointHandle point = keyframe.points[i];
      if (!point || is_listed_[point.index] != 0) continue;
      is_listed_[point.index] = 1;
      out->push_back(point);
    }
  }
  for (const MapPointHandle point : *out) is_listed_[point.index] = 0;
}

void CollectGroup(const Atlas& atlas, KeyframeHandle keyframe, int max_keyframes, int min_shared,
                  std::vector<Covisible>* covisible, std::vector<KeyframeHandle>* out) {
  out->assign(1, keyframe);
  atlas.FindCovisible(keyframe, min_shared, covisible);
  for (const Covisible& neighbour : *covisible) {
    if (out->size() >= static_cast<std::size_t>(max_keyframes)) break;
    out->push_back(neighbour.keyframe);
  }
}

}  // namespace haustra
