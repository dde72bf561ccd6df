#include "engine/mapping/local_bundle.h"

#include <algorithm>

namespace haustra {

LocalBundle::LocalBundle(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                         SchurBundleAdjuster& adjuster)
    : config_(config),
      noise_(noise),
      camera_(camera),
      adjuster_(adjuster),
      pose_slots_(static_cast<std::size_t>(config.memory.max_keyframes), -1),
      point_slots_(static_cast<std::size_t>(config.memory.max_map_points), -1),
      ring_votes_(static_cast<std::size_t>(config.memory.max_keyframes), 0) {}

Result<BundleSummary> LocalBundle::Adjust(KeyframeHandle centre, const Extent& extent, const Limits& limits,
                                          Atlas* atlas) {
  ChooseWindow(centre, extent, *atlas);
  FillProblem(*atlas);
  BundleOptions options;
  options.max_iterations = extent.max_iterations;
  options.clock = limits.clock;
  options.deadline = limits.deadline;
  options.should_stop = limits.should_stop;
  Result<BundleSummary> summary = adjuster_.Adjust(camera_, options, &problem_);
  if (summary.ok() && summary->state != SolveState::kNone) WriteBack(atlas);
  for (const KeyframeHandle handle : poses_) pose_slots_[handle.index] = -1;
  for (const MapPointHandle handle : points_) point_slots_[handle.index] = -1;
  return summary;
}

void LocalBundle::ChooseWindow(KeyframeHandle centre, const Extent& extent, const Atlas& atlas) {
  poses_.clear();
  points_.clear();
  poses_.push_back(centre);
  pose_slots_[centre.index] = 0;
  // Breadth first: poses_ is the queue, too.
  const auto max_keyframes = static_cast<std::size_t>(extent.max_keyframes);
  for (std::size_t i = 0; i < poses_.size() && poses_.size() < max_keyframes; ++i) {
    if (extent.is_direct && i > 0) break;
    atlas.FindCovisible(poses_[i], config_.mapping.min_shared_points, &covisible_);
    for (const Covisible& covisible : covisible_) {
      if (poses_.size() == max_keyframes) break;
      if (pose_slots_[covisible.keyframe.index] >= 0) continue;
      pose_slots_[covisible.keyframe.index] = static_cast<std::int32_t>(poses_.size());
      poses_.push_back(covisible.keyframe);
    }
  }
  window_size_ = poses_.size();

  // The ring: the keyframes outside that see most of the window's points.
  std::vector<KeyframeHandle> ring;
  for (std::size_t i = 0; i < window_size_; ++i) {
    const Keyframe& keyframe = atlas.keyframe(poses_[i]);
    for (int f = 0; f < keyframe.features.num; ++f) {
      const MapPointHandle point = keyframe.points[f];
      if (!point || point_slots_[point.index] >= 0) continue;
      point_slots_[point.index] = static_cast<std::int32_t>(points_.size());
      points_.push_back(point);
      for (const Observation& observation : atlas.point(point).observations) {
        if (pose_slots_[observation.keyframe.index] >= 0) continue;
        if (ring_votes_[observation.keyframe.index]++ == 0) ring.push_back(observation.keyframe);
      }
    }
  }
  std::sort(ring.begin(), ring.end(), [&](KeyframeHandle a, KeyframeHandle b) {
    const int votes_a = ring_votes_[a.index];
    const int votes_b = ring_votes_[b.index];
    return votes_a != votes_b ? votes_a > votes_b : atlas.keyframe(a).id < atlas.keyframe(b).id;
  });
  for (const KeyframeHandle handle : ring) ring_votes_[handle.index] = 0;
  if (ring.size() > static_cast<std::size_t>(config_.mapping.fixed_keyframes)) {
    ring.resize(static_cast<std::size_t>(config_.mapping.fixed_keyframes));
  }
  for (const KeyframeHandle handle : ring) {
    pose_slots_[handle.index] = static_cast<std::int32_t>(poses_.size());
    poses_.push_back(handle);
  }
}

// A list that doubled as it grew would take more.
void LocalBundle::ReserveObservations(const Atlas& atlas) {
  std::size_t num = 0;
  for (const MapPointHandle point : points_) {
    for (const Observation& observation : atlas.point(point).observations) {
      num += pose_slots_[observation.keyframe.index] >= 0 ? 1 : 0;
    }
  }
  if (problem_.observations.capacity() >= num) return;
  std::vector<BundleObservation>().swap(problem_.observations);
  problem_.observations.reserve(num);
}

void LocalBundle::FillProblem(const Atlas& atlas) {
  problem_.poses.clear();
  problem_.points.clear();
  problem_.observations.clear();
  // Without a ring the oldest keyframe of the window holds the frame of reference.
  std::size_t oldest = 0;
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    const Keyframe& keyframe = atlas.keyframe(poses_[i]);
    problem_.poses.push_back({keyframe.cam_from_map, i >= window_size_});
    if (keyframe.id < atlas.keyframe(poses_[oldest]).id) oldest = i;
  }
  if (poses_.size() == window_size_) problem_.poses[oldest].is_fixed = true;
  ReserveObservations(atlas);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const MapPoint& point = atlas.point(points_[i]);
    problem_.points.push_back({point.position, false});
    for (const Observation& observation : point.observations) {
      const std::int32_t pose = pose_slots_[observation.keyframe.index];
      if (pose < 0) continue;
      const FrameFeatures& features = atlas.keyframe(observation.keyframe).features;
      problem_.observations.push_back({pose, static_cast<std::int32_t>(i), features.pixel(observation.feature_idx),
                                       noise_.SigmaPx(features.keypoints[observation.feature_idx].scale_px), false});
    }
  }
}

void LocalBundle::WriteBack(Atlas* atlas) {
  for (std::size_t i = 0; i < window_size_; ++i) {
    atlas->keyframe(poses_[i]).cam_from_map = problem_.poses[i].cam_from_world;
  }
  for (std::size_t i = 0; i < points_.size(); ++i) atlas->point(points_[i]).position = problem_.points[i].position;
  for (const BundleObservation& observation : problem_.observations) {
    if (!observation.is_outlier) continue;
    const MapPointHandle point = points_[observation.point_idx];
    if (atlas->GetPoint(point) != nullptr) atlas->RemoveObservation(point, poses_[observation.pose_idx]);
  }
  for (const MapPointHandle point : points_) {
    if (atlas->GetPoint(point) != nullptr) atlas->UpdatePoint(point);
  }
}

}  // namespace haustra
