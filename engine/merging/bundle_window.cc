#include "engine/merging/bundle_window.h"

#include <algorithm>

namespace haustra {

BundleWindow::BundleWindow(const MemoryConfig& memory, const NoiseModel& noise, const CameraModel& camera,
                           SchurBundleAdjuster& adjuster)
    : noise_(noise),
      camera_(camera),
      adjuster_(adjuster),
      pose_slots_(static_cast<std::size_t>(memory.max_keyframes), -1),
      point_slots_(static_cast<std::size_t>(memory.max_map_points), -1),
      ring_votes_(static_cast<std::size_t>(memory.max_keyframes), 0) {}

void BundleWindow::Clear() {
  for (const KeyframeHandle handle : poses_) pose_slots_[handle.index] = -1;
  for (const MapPointHandle handle : points_) point_slots_[handle.index] = -1;
  poses_.clear();
  points_.clear();
  num_moving_ = 0;
}

bool BundleWindow::Add(KeyframeHandle keyframe) {
  if (pose_slots_[keyframe.index] >= 0) return false;
  pose_slots_[keyframe.index] = static_cast<std::int32_t>(poses_.size());
  poses_.push_back(keyframe);
  num_moving_ = poses_.size();
  return true;
}

void BundleWindow::Close(const Atlas& atlas, int max_fixed, const std::function<bool(KeyframeHandle)>& may_hold) {
  for (const KeyframeHandle handle : ListRing(atlas)) {
    if (num_fixed() == static_cast<std::size_t>(max_fixed)) break;
    if (may_hold && !may_hold(handle)) continue;
    pose_slots_[handle.index] = static_cast<std::int32_t>(poses_.size());
    poses_.push_back(handle);
  }
  Fill(atlas);
}

// Takes the points in; the keyframes outside that see them, those that see most first.
std::vector<KeyframeHandle> BundleWindow::ListRing(const Atlas& atlas) {
  std::vector<KeyframeHandle> ring;
  for (const KeyframeHandle handle : moving()) {
    const Keyframe& keyframe = atlas.keyframe(handle);
    for (std::int32_t f = 0; f < keyframe.features.num; ++f) {
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
    const int votes_a = ring_votes_[a.index], votes_b = ring_votes_[b.index];
    return votes_a != votes_b ? votes_a > votes_b : atlas.keyframe(a).id < atlas.keyframe(b).id;
  });
  for (const KeyframeHandle handle : ring) ring_votes_[handle.index] = 0;
  return ring;
}

// A list that doubled as it grew would take more.
void BundleWindow::ReserveObservations(const Atlas& atlas) {
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

void BundleWindow::Fill(const Atlas& atlas) {
  problem_.poses.clear();
  problem_.points.clear();
  problem_.observations.clear();
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    problem_.poses.push_back({atlas.keyframe(poses_[i]).cam_from_map, i >= num_moving_});
  }
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

Result<BundleSummary> BundleWindow::Adjust(const BundleOptions& options, Atlas* atlas) {
  Result<BundleSummary> summary = Solve(options);
  if (summary.ok() && summary->state != SolveState::kNone) WriteBack(atlas);
  return summary;
}

void BundleWindow::WriteBack(Atlas* atlas) {
  for (std::size_t i = 0; i < num_moving_; ++i) {
    Keyframe* keyframe = atlas->GetKeyframe(poses_[i]);
    if (keyframe != nullptr) keyframe->cam_from_map = problem_.poses[i].cam_from_world;
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    MapPoint* point = atlas->GetPoint(points_[i]);
    if (point != nullptr) point->position = problem_.points[i].position;
  }
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
