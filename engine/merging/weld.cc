#include "engine/merging/weld.h"

#include <algorithm>

namespace haustra {
namespace {

// Fewer ring keyframes leave the scale to the noise: the reference side itself then holds the gauge.
constexpr std::size_t kMinRing = 2;

}  // namespace

Weld::Weld(const EngineConfig& config, const MergingConfig& options, const NoiseModel& noise, const CameraModel& camera,
           SchurBundleAdjuster& adjuster)
    : config_(config),
      noise_(noise),
      options_(options),
      camera_(camera),
      adjuster_(adjuster),
      pose_slots_(static_cast<std::size_t>(config.memory.max_keyframes), -1),
      point_slots_(static_cast<std::size_t>(config.memory.max_map_points), -1),
      ring_votes_(static_cast<std::size_t>(config.memory.max_keyframes), 0) {}

Result<BundleSummary> Weld::Adjust(const Sides& sides, Atlas* atlas, const Clock* clock, TimePoint deadline) {
  ChooseKeyframes(sides, *atlas);
  FillProblem(sides, *atlas);
  BundleOptions options;
  options.max_iterations = options_.weld_iterations;
  options.clock = clock;
  options.deadline = deadline;
  const double before = MedianDistance(sides.moving.size());
  Result<BundleSummary> summary = adjuster_.Adjust(camera_, options, &problem_);
  moving_scale_ = 1.0;
  if (summary.ok() && summary->state != SolveState::kNone) {
    const double after = MedianDistance(sides.moving.size());
    if (before > 0.0 && after > 0.0) moving_scale_ = after / before;
    WriteBack(atlas);
  }
  for (const KeyframeHandle handle : poses_) pose_slots_[handle.index] = -1;
  for (const MapPointHandle handle : points_) point_slots_[handle.index] = -1;
  return summary;
}

void Weld::ChooseKeyframes(const Sides& sides, const Atlas& atlas) {
  poses_.clear();
  points_.clear();
  for (const std::span<const KeyframeHandle> side : {sides.moving, sides.reference}) {
    for (const KeyframeHandle handle : side) {
      if (pose_slots_[handle.index] >= 0) continue;
      pose_slots_[handle.index] = static_cast<std::int32_t>(poses_.size());
      poses_.push_back(handle);
    }
  }
  num_free_ = poses_.size();

  std::vector<KeyframeHandle> ring;
  for (std::size_t i = 0; i < num_free_; ++i) {
    const Keyframe& keyframe = atlas.keyframe(poses_[i]);
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
  for (const KeyframeHandle handle : ring) {
    if (poses_.size() == num_free_ + static_cast<std::size_t>(options_.fixed_keyframes)) break;
    if (!sides.may_hold(handle)) continue;
    pose_slots_[handle.index] = static_cast<std::int32_t>(poses_.size());
    poses_.push_back(handle);
  }
}

void Weld::FillProblem(const Sides& sides, const Atlas& atlas) {
  problem_.poses.clear();
  problem_.points.clear();
  problem_.observations.clear();
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    problem_.poses.push_back({atlas.keyframe(poses_[i]).cam_from_map, i >= num_free_});
  }
  if (poses_.size() < num_free_ + kMinRing) {
    for (std::size_t i = sides.moving.size(); i < num_free_; ++i) problem_.poses[i].is_fixed = true;
  }
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

// Between the cameras of the moving side and what they see, in the problem as it stands.
double Weld::MedianDistance(std::size_t num_moving) const {
  std::vector<double> distances;
  for (const BundleObservation& observation : problem_.observations) {
    if (observation.pose_idx >= static_cast<std::int32_t>(num_moving)) continue;
    const Eigen::Vector3d centre = problem_.poses[observation.pose_idx].cam_from_world.InverseTranslation();
    distances.push_back((problem_.points[observation.point_idx].position - centre).norm());
  }
  if (distances.empty()) return 0.0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

void Weld::WriteBack(Atlas* atlas) {
  for (std::size_t i = 0; i < num_free_; ++i) {
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
