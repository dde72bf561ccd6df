#include "engine/atlas/invariants.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

namespace haustra {
namespace {

Status CheckPoint(const Atlas& atlas, MapPointHandle handle, const MapPoint& point) {
  const std::string name = "map point " + std::to_string(point.id) + ": ";
  if (!atlas.maps().Contains(point.map)) return Internal(name + "its map is gone");
  if (!point.position.allFinite()) return Internal(name + "position is not finite");
  if (point.observations.size() < 2) return Internal(name + "fewer than two observations");
  bool has_descriptor = false;
  for (const Observation& observation : point.observations) {
    const Keyframe* keyframe = atlas.GetKeyframe(observation.keyframe);
    if (keyframe == nullptr) return Internal(name + "observed by a keyframe that is gone");
    if (keyframe->map != point.map) return Internal(name + "observed from another map");
    if (observation.feature_idx < 0 || observation.feature_idx >= keyframe->features.num) {
      return Internal(name + "feature index out of range");
    }
    if (keyframe->points[observation.feature_idx] != handle) {
      return Internal(name + "keyframe " + std::to_string(keyframe->id) + " does not know of the observation");
    }
    has_descriptor = has_descriptor || keyframe->features.set == point.descriptor.set;
  }
  if (!has_descriptor) return Internal(name + "its descriptor belongs to no observer");
  return Status::Ok();
}

Status CheckKeyframe(const Atlas& atlas, KeyframeHandle handle, const Keyframe& keyframe) {
  const std::string name = "keyframe " + std::to_string(keyframe.id) + ": ";
  if (!atlas.maps().Contains(keyframe.map)) return Internal(name + "its map is gone");
  const auto& list = atlas.map(keyframe.map).keyframes;
  if (std::count(list.begin(), list.end(), handle) != 1) return Internal(name + "is not once in its map's list");
  int num_points = 0;
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i]) continue;
    const MapPoint* point = atlas.GetPoint(keyframe.points[i]);
    if (point == nullptr) return Internal(name + "refers to a point that is gone");
    if (atlas.FeatureOf(*point, handle) != i) return Internal(name + "its point does not know of the observation");
    ++num_points;
  }
  if (num_points != keyframe.num_points) return Internal(name + "counts its points wrongly");
  return Status::Ok();
}

Status CheckMark(const Atlas& atlas, const Mark& mark) {
  const std::string name = "mark " + std::to_string(mark.id) + ": ";
  if (atlas.GetKeyframe(mark.keyframe) == nullptr) return Internal(name + "the keyframe that holds it is gone");
  if (!MarkLabel::From(mark.label.view())) return Internal(name + "its label is none");
  if (atlas.marks().Get(atlas.FindMark(mark.label.view())) != &mark) return Internal(name + "another has its label");
  if (mark.id >= atlas.counters().next_mark_id) return Internal(name + "its id was never given");
  const bool is_finite = mark.point_in_anchor.allFinite() && mark.normal_in_anchor.allFinite() &&
                         std::isfinite(mark.radius) && std::isfinite(mark.scale);
  if (!is_finite) return Internal(name + "its place is not finite");
  if (std::abs(mark.normal_in_anchor.norm() - 1.0) > 1e-6) return Internal(name + "its normal is not a unit vector");
  if (mark.radius <= 0.0 || mark.scale <= 0.0) return Internal(name + "its lengths are not positive");
  return Status::Ok();
}

}  // namespace

Status CheckInvariants(const Atlas& atlas) {
  Status status;
  std::map<MapHandle, int> points_in_map;
  atlas.points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
    if (status.ok()) status = CheckPoint(atlas, handle, point);
    ++points_in_map[point.map];
  });
  atlas.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& keyframe) {
    if (status.ok()) status = CheckKeyframe(atlas, handle, keyframe);
  });
  atlas.marks().ForEach([&](MarkHandle, const Mark& mark) {
    if (status.ok()) status = CheckMark(atlas, mark);
  });
  atlas.maps().ForEach([&](MapHandle handle, const Map& map) {
    if (!status.ok()) return;
    const std::string name = "map " + std::to_string(map.id) + ": ";
    if (points_in_map[handle] != map.num_points) status = Internal(name + "counts its points wrongly");
    for (const KeyframeHandle keyframe : map.keyframes) {
      if (atlas.GetKeyframe(keyframe) == nullptr) status = Internal(name + "lists a keyframe that is gone");
    }
  });
  return status;
}

}  // namespace haustra
