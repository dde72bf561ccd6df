#include "engine/place/projected_search.h"

#include "engine/camera/view_queries.h"

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
  const ViewQueries view_queries(config_.matching, camera_, noise_, view.cam_from_view_map);
  const std::size_t max_queries = static_cast<std::size_t>(device_.plan().max_match_list);
  for (std::size_t i = 0; i < points.size() && queries_.size() < max_queries; ++i) {
    SearchedPoint point = points[i];
    point.position = view_map_from_map * point.position;
    point.normal = view_map_from_map.rotation * point.normal;
    point.scale_times_distance *= view_map_from_map.scale;
    GuidedQuery query;
    if (!view_queries.OfPoint(point, &query)) continue;
    queries_.push_back(query);
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
  request.options = GuidedOptions(config_.matching);
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
