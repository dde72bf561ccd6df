#include "engine/mapping/late_placement.h"

#include "engine/camera/view_queries.h"

namespace haustra {

LatePlacement::LatePlacement(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                             VisionDevice& device)
    : config_(config),
      noise_(noise),
      camera_(camera),
      device_(device),
      pose_from_matches_(camera, config.features.max) {}

bool LatePlacement::Place(const ProposedView& view, const SE3& guess, KeyframeHandle handle, const Atlas& atlas,
                          PlacedView* out) {
  queries_.clear();
  query_points_.clear();
  const Keyframe& keyframe = atlas.keyframe(handle);
  const ViewQueries view_queries(config_.matching, camera_, noise_, guess);
  const double radius_px = config_.tracking.motion_radius_deg * kDegree * camera_.focal_px();
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i]) continue;
    GuidedQuery query;
    const DescriptorRef descriptor{keyframe.features.set, i};
    if (!view_queries.OfFeature(atlas.point(keyframe.points[i]).position, descriptor,
                                keyframe.features.keypoints[i].scale_px, radius_px, &query)) {
      continue;
    }
    queries_.push_back(query);
    query_points_.push_back(keyframe.points[i]);
  }
  matches_.resize(queries_.size());
  std::int32_t num_matches = 0;
  GuidedMatchRequest request;
  request.queries = queries_;
  request.train = view.features.set;
  request.options = GuidedOptions(config_.matching);
  request.matches = matches_;
  request.num_matches = &num_matches;
  if (queries_.empty() || !GuidedMatchAndWait(device_, Lane::kBackground, request).ok()) return false;

  pose_from_matches_.Clear();
  for (int m = 0; m < num_matches; ++m) {
    pose_from_matches_.Add(atlas.point(query_points_[matches_[m].query]).position,
                           view.features.pixel(matches_[m].train),
                           noise_.SigmaPx(view.features.keypoints[matches_[m].train].scale_px));
  }
  PoseOptimizerResult pose;
  if (!pose_from_matches_.Fit(guess, config_.tracking.min_inliers, &pose)) return false;
  if (2 * pose.num_inliers < num_matches) return false;
  out->frame_index = view.frame_index;
  out->cam_from_map = pose.cam_from_world;
  out->sightings.clear();
  for (int m = 0; m < num_matches; ++m) {
    if (pose_from_matches_.inliers()[m] == 0) continue;
    const PoseObservation& match = pose_from_matches_.matches()[m];
    out->sightings.push_back({query_points_[matches_[m].query], match.pixel, match.sigma_px});
  }
  return true;
}

}  // namespace haustra
