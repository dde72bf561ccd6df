#include "tools/benchmarks/view_atlas.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/geometry/triangulation.h"
#include "tools/evaluate/statistics.h"

namespace haustra::benchmarks {
namespace {

Atlas::Capacity CapacityFor(const EngineConfig& config, int max_views) {
  // A point lives for two views and more; some hundreds are new in each.
  return {max_views, 400 * max_views, 64, max_views + 1, config.features.max};
}

}  // namespace

ViewAtlas::ViewAtlas(const EngineConfig& config, int max_views, VisionDevice& device)
    : config_(config),
      device_(device),
      atlas_(CapacityFor(config, max_views)),
      matches_(static_cast<std::size_t>(config.features.max)) {}

Status ViewAtlas::Connect(MapHandle map, PlacedView* earlier, PlacedView* later) {
  constexpr double kDegPerRad = 180.0 / std::numbers::pi;
  constexpr double kMinParallaxDeg = 0.5, kMaxErrorDeg = 0.2;
  constexpr std::size_t kMinDepths = 20;
  MatchRequest request;
  request.query = DescriptorList::Whole(earlier->view->features.set);
  request.train = DescriptorList::Whole(later->view->features.set);
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.matching.brute_force_ratio), true};
  request.matches = matches_;
  std::int32_t num_matches = 0;
  request.num_matches = &num_matches;
  HAUSTRA_TRY(MatchAndWait(device_, Lane::kBackground, request));
  const bool is_posed = earlier->view->world_from_cam && later->view->world_from_cam;
  const SE3 later_from_earlier =
      is_posed ? later->view->world_from_cam->Inverse() * *earlier->view->world_from_cam : SE3();
  std::vector<double> depths;
  for (const Match& match : std::span(matches_).first(num_matches)) {
    MapPointHandle point = atlas_.keyframe(earlier->keyframe).points[match.query];
    if (!point.is_valid()) {
      point = atlas_.AddPoint(map, Eigen::Vector3d::UnitZ(), atlas_.keyframe(earlier->keyframe).id);
      if (!point.is_valid()) return CapacityExceeded("the benchmark's atlas holds no more points");
      atlas_.AddObservation(point, earlier->keyframe, match.query);
    }
    // A full list of observations begins a new point at the next match.
    atlas_.AddObservation(point, later->keyframe, match.train);
    if (!is_posed) continue;
    const Eigen::Vector3d bearing = earlier->view->features.bearing(match.query);
    Triangulated triangulated;
    if (!TriangulateBearings(later_from_earlier, bearing, later->view->features.bearing(match.train), &triangulated)) {
      continue;
    }
    const auto angle_deg = [&](double cosine) { return std::acos(std::clamp(cosine, -1.0, 1.0)) * kDegPerRad; };
    if (angle_deg(triangulated.cos_parallax) < kMinParallaxDeg) continue;
    if (angle_deg(bearing.dot(triangulated.point_in_a.normalized())) > kMaxErrorDeg) continue;
    depths.push_back(triangulated.point_in_a.norm());
  }
  if (depths.size() < kMinDepths) return Status::Ok();
  earlier->depth = evaluate::Median(depths);
  if (later->depth == 0.0) later->depth = earlier->depth;  // until its own successor says better
  return Status::Ok();
}

Result<std::vector<PlacedView>> ViewAtlas::AddSequence(const RecordedSequence& sequence, int step) {
  std::vector<PlacedView> placed;
  const MapHandle map = atlas_.CreateMap();
  if (!map.is_valid()) return CapacityExceeded("the benchmark's atlas holds no more maps");
  for (std::size_t i = 0; i < sequence.views.size(); i += static_cast<std::size_t>(step)) {
    const RecordedView& view = sequence.views[i];
    if (!view.is_clear) continue;
    PlacedView added;
    added.view = &view;
    added.keyframe = atlas_.AddKeyframe(map, static_cast<std::uint32_t>(i), view.timestamp,
                                        view.world_from_cam ? view.world_from_cam->Inverse() : SE3(), view.features);
    if (!added.keyframe.is_valid()) return CapacityExceeded("the benchmark's atlas holds no more keyframes");
    placed.push_back(added);
    if (placed.size() >= 2) HAUSTRA_TRY(Connect(map, &placed[placed.size() - 2], &placed.back()));
  }
  // Views without a depth of their own take that of the one before, or after.
  for (std::size_t i = 1; i < placed.size(); ++i) {
    if (placed[i].depth == 0.0) placed[i].depth = placed[i - 1].depth;
  }
  for (std::size_t i = placed.size(); i-- > 1;) {
    if (placed[i - 1].depth == 0.0) placed[i - 1].depth = placed[i].depth;
  }
  return placed;
}

}  // namespace haustra::benchmarks
