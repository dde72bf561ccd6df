#include "engine/atlas/local_map.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

namespace haustra {
namespace {

constexpr int kFirstRing = 24;
constexpr int kNeighboursOfNeighbours = 4;
// Keyframes that look the same way from nearby, although no point connects them yet: how a place that was left and is
// seen again joins the window before drift grows.
constexpr double kNearViewCos = 0.7;

// When the last of the first kEstablishedViews keyframes that see a point was taken; of both in a map of two.
TimePoint EstablishedAt(const LocalMap& map, std::uint64_t mask) {
  std::array<TimePoint, kEstablishedViews> first;
  first.fill(TimePoint::max());
  for (; mask != 0; mask &= mask - 1) {
    TimePoint taken = map.keyframes[std::countr_zero(mask)].taken;
    for (TimePoint& earlier : first) {
      if (taken < earlier) std::swap(taken, earlier);
    }
  }
  return first[static_cast<std::size_t>(std::min(kEstablishedViews, static_cast<int>(map.keyframes.size()))) - 1];
}

}  // namespace

int LocalMap::Find(MapPointHandle handle) const {
  const auto end = points.begin() + num_points;
  const auto it = std::lower_bound(points.begin(), end, handle.index, [](const LocalPoint& point, std::uint32_t index) {
    return point.handle.index < index;
  });
  return it != end && it->handle == handle ? static_cast<int>(it - points.begin()) : -1;
}

LocalMapBuilder::LocalMapBuilder(int max_keyframes, int max_map_points)
    : has_keyframe_(static_cast<std::size_t>(max_keyframes), 0),
      point_slots_(static_cast<std::size_t>(max_map_points), -1) {}

void LocalMapBuilder::AddKeyframe(const Atlas& atlas, KeyframeHandle handle, LocalMap* out) {
  if (has_keyframe_[handle.index] != 0) return;
  const Keyframe& keyframe = atlas.keyframe(handle);
  LocalKeyframe entry;
  entry.handle = handle;
  entry.id = keyframe.id;
  entry.taken = atlas.IsOfThisSession(keyframe.id) ? keyframe.timestamp : TimePoint::min();
  entry.cam_from_map = keyframe.cam_from_map;
  entry.scale = atlas.KeyframeScale(handle);
  entry.is_reduced = keyframe.features.is_reduced;
  if (out->keyframes.PushBack(entry)) has_keyframe_[handle.index] = 1;
}

void LocalMapBuilder::Build(const Atlas& atlas, KeyframeHandle centre, LocalMap* out) {
  out->keyframes.Clear();
  out->num_points = 0;
  AddKeyframe(atlas, centre, out);

  atlas.FindCovisible(centre, 1, &covisible_);
  for (std::size_t i = 0; i < covisible_.size() && i < kFirstRing; ++i) AddKeyframe(atlas, covisible_[i].keyframe, out);

  const std::size_t ring_end = out->keyframes.size();
  for (std::size_t i = 1; i < ring_end; ++i) {
    atlas.FindCovisible(out->keyframes[i].handle, 10, &second_ring_);
    int added = 0;
    for (const Covisible& next : second_ring_) {
      if (has_keyframe_[next.keyframe.index] != 0) continue;
      AddKeyframe(atlas, next.keyframe, out);
      if (++added == kNeighboursOfNeighbours) break;
    }
  }

  bool has_all = AddPoints(atlas, out);
  const double depth = (out->keyframes[0].cam_from_map * out->keyframes[0].centroid).norm();
  const Eigen::Vector3d position = out->keyframes[0].cam_from_map.InverseTranslation();
  const Eigen::Vector3d axis = out->keyframes[0].cam_from_map.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const std::size_t before = out->keyframes.size();
  for (const KeyframeHandle handle : atlas.map(atlas.keyframe(centre).map).keyframes) {
    const SE3& pose = atlas.keyframe(handle).cam_from_map;
    if ((pose.InverseTranslation() - position).norm() > depth) continue;
    if ((pose.rotation.conjugate() * Eigen::Vector3d::UnitZ()).dot(axis) < kNearViewCos) continue;
    AddKeyframe(atlas, handle, out);
  }
  if (out->keyframes.size() > before) has_all = AddPoints(atlas, out);
  if (!has_all) ++num_cut_;

  std::sort(out->points.begin(), out->points.begin() + out->num_points,
            [](const LocalPoint& a, const LocalPoint& b) { return a.handle.index < b.handle.index; });
  for (const LocalKeyframe& keyframe : out->keyframes) has_keyframe_[keyframe.handle.index] = 0;
}

// Collects the points of all keyframes in the window anew, nearest keyframes first. False when some found no room.
bool LocalMapBuilder::AddPoints(const Atlas& atlas, LocalMap* out) {
  out->num_points = 0;
  bool has_all = true;
  for (std::size_t k = 0; k < out->keyframes.size(); ++k) {
    LocalKeyframe& entry = out->keyframes[k];
    const Keyframe& keyframe = atlas.keyframe(entry.handle);
    entry.num_points = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int i = 0; i < keyframe.features.num; ++i) {
      const MapPointHandle handle = keyframe.points[i];
      if (!handle) continue;
      std::int32_t& slot = point_slots_[handle.index];
      const MapPoint& point = atlas.point(handle);
      if (slot < 0) {
        if (out->num_points == static_cast<int>(out->points.size())) {
          has_all = false;
          continue;
        }
        slot = out->num_points++;
        out->points[slot] = {handle, point.position, point.normal, point.scale_times_distance, point.descriptor};
      }
      out->points[slot].keyframe_mask |= std::uint64_t{1} << k;
      sum += point.position;
      ++entry.num_points;
    }
    if (entry.num_points > 0) entry.centroid = sum / entry.num_points;
  }
  for (LocalKeyframe& keyframe : out->keyframes) keyframe.num_established = 0;
  for (int i = 0; i < out->num_points; ++i) {
    LocalPoint& point = out->points[i];
    point_slots_[point.handle.index] = -1;
    if (!out->is_established(point)) continue;
    std::uint64_t mask = point.keyframe_mask;
    point.established = EstablishedAt(*out, mask);
    for (; mask != 0; mask &= mask - 1) ++out->keyframes[std::countr_zero(mask)].num_established;
  }
  return has_all;
}

}  // namespace haustra
