#include "engine/mapping/point_fusion.h"

#include "engine/camera/view_queries.h"

namespace haustra {

PointFuser::PointFuser(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                       VisionDevice& device)
    : config_(config), noise_(noise), camera_(camera), device_(device) {}

int PointFuser::SearchInto(KeyframeHandle handle, std::span<const MapPointHandle> candidates, Atlas* atlas) {
  queries_.clear();
  query_points_.clear();
  const Keyframe& keyframe = atlas->keyframe(handle);
  const ViewQueries view_queries(config_.matching, camera_, noise_, keyframe.cam_from_map);
  const std::size_t max_queries = static_cast<std::size_t>(device_.plan().max_match_list);
  for (const MapPointHandle candidate : candidates) {
    const MapPoint* point = atlas->GetPoint(candidate);
    if (point == nullptr || queries_.size() == max_queries) continue;
    GuidedQuery query;
    if (!view_queries.OfPoint(*point, &query) || atlas->FeatureOf(*point, handle) >= 0) continue;
    queries_.push_back(query);
    query_points_.push_back(candidate);
  }
  if (queries_.empty()) return 0;
  matches_.resize(queries_.size());
  std::int32_t num_matches = 0;
  GuidedMatchRequest request;
  request.queries = queries_;
  request.train = keyframe.features.set;
  request.options = GuidedOptions(config_.matching);
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
