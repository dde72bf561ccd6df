#include "engine/place/place_excerpt.h"

#include <algorithm>

namespace haustra {
namespace {

// Covisible keyframes of a candidate whose points the neighbours of the new keyframe may see.
constexpr int kWideGroup = 8;

// From the older of the two to the younger, along the keyframes of their map.
double WayBetween(const Atlas& atlas, const Keyframe& a, const Keyframe& b) {
  double way = 0.0;
  const Keyframe* former = nullptr;
  const KeyframeId first = std::min(a.id, b.id), last = std::max(a.id, b.id);
  for (const KeyframeHandle handle : atlas.map(a.map).keyframes) {
    const Keyframe& keyframe = atlas.keyframe(handle);
    if (keyframe.id < first || keyframe.id > last) continue;
    if (former != nullptr) {
      way += (keyframe.cam_from_map.InverseTranslation() - former->cam_from_map.InverseTranslation()).norm();
    }
    former = &keyframe;
  }
  return way;
}

}  // namespace

GroupExcerpt::GroupExcerpt(const Capacity& capacity, std::pmr::memory_resource* memory)
    : keyframes(memory), points(memory), handles(memory), sights(memory) {
  keyframes.reserve(static_cast<std::size_t>(capacity.keyframes));
  for (int i = 0; i < capacity.keyframes; ++i) keyframes.emplace_back(capacity.features, memory);
  points.reserve(static_cast<std::size_t>(capacity.points));
  handles.reserve(static_cast<std::size_t>(capacity.points));
  if (capacity.has_sights) sights.reserve(static_cast<std::size_t>(capacity.points));
}

std::size_t GroupExcerpt::BytesFor(const Capacity& capacity) {
  const auto num_keyframes = static_cast<std::size_t>(capacity.keyframes);
  const auto num_points = static_cast<std::size_t>(capacity.points);
  return MemoryArena::BytesFor<KeyframeExcerpt>(num_keyframes) +
         num_keyframes * KeyframeExcerpt::BytesFor(capacity.features) +
         MemoryArena::BytesFor<SearchedPoint>(num_points) + MemoryArena::BytesFor<MapPointHandle>(num_points) +
         (capacity.has_sights ? MemoryArena::BytesFor<PointSight>(num_points) : 0);
}

GroupExcerpt::Capacity GroupExcerpt::ForQuery(const EngineConfig& config) {
  const int num_keyframes = 1 + config.place.common_area.confirming_keyframes;
  return {num_keyframes, config.features.max, num_keyframes * config.features.max, false};
}

GroupExcerpt::Capacity GroupExcerpt::ForCandidate(const EngineConfig& config) {
  const int num_keyframes = config.place.common_area.group_size;
  // Of the features of a keyframe that have a point most see one that their neighbours see, too.
  return {num_keyframes, config.features.max, std::max(3, num_keyframes) * config.features.max, true};
}

ExcerptCopier::ExcerptCopier(const EngineConfig& config)
    : config_(config), index_of_(static_cast<std::size_t>(config.memory.max_map_points), -1) {}

void ExcerptCopier::Begin(const Atlas& atlas, KeyframeHandle handle, GroupExcerpt* out) {
  const Keyframe& keyframe = atlas.keyframe(handle);
  out->keyframe = handle;
  out->id = keyframe.id;
  out->map_id = atlas.map(keyframe.map).id;
  out->scale = atlas.KeyframeScale(handle);
  out->num_points = keyframe.num_points;
  out->num_keyframes = 0;
  out->points.clear();
  out->handles.clear();
  out->sights.clear();
  out->way = 0.0;
}

void ExcerptCopier::AddPoints(const Atlas& atlas, const Keyframe& keyframe, GroupExcerpt* out) {
  const bool has_sights = out->sights.capacity() > 0;
  for (std::int32_t i = 0; i < keyframe.features.num; ++i) {
    const MapPointHandle handle = keyframe.points[i];
    if (!handle || index_of_[handle.index] >= 0) continue;
    if (out->points.size() == out->points.capacity()) {
      ++num_points_left_out_;
      continue;
    }
    const MapPoint& point = atlas.point(handle);
    index_of_[handle.index] = static_cast<std::int32_t>(out->points.size());
    out->points.push_back(AsSearched(point));
    out->handles.push_back(handle);
    if (!has_sights) continue;
    const Observation& observation = *point.observations.begin();
    const Keyframe& observer = atlas.keyframe(observation.keyframe);
    out->sights.push_back({observer.cam_from_map, observer.features.pixel(observation.feature_idx),
                           observer.features.keypoints[observation.feature_idx].scale_px});
  }
}

void ExcerptCopier::AddKeyframe(const Atlas& atlas, const Keyframe& keyframe, GroupExcerpt* out) {
  AddPoints(atlas, keyframe, out);
  KeyframeExcerpt& copy = out->keyframes[static_cast<std::size_t>(out->num_keyframes++)];
  copy.cam_from_map = keyframe.cam_from_map;
  copy.set = keyframe.features.set;
  copy.num = keyframe.features.num;
  std::copy_n(keyframe.features.keypoints.begin(), copy.num, copy.keypoints.begin());
  for (std::int32_t i = 0; i < copy.num; ++i) {
    copy.points[i] = keyframe.points[i] ? index_of_[keyframe.points[i].index] : -1;
  }
}

void ExcerptCopier::End(const GroupExcerpt& out) {
  for (const MapPointHandle handle : out.handles) index_of_[handle.index] = -1;
}

void ExcerptCopier::CopyQuery(const Atlas& atlas, KeyframeHandle keyframe, GroupExcerpt* out) {
  Begin(atlas, keyframe, out);
  AddKeyframe(atlas, atlas.keyframe(keyframe), out);
  out->num_searched = out->points.size();
  CollectGroup(atlas, keyframe, 1 + config_.place.common_area.confirming_keyframes, config_.mapping.min_shared_points,
               &covisible_, &group_);
  for (std::size_t i = 1; i < group_.size(); ++i) AddKeyframe(atlas, atlas.keyframe(group_[i]), out);
  End(*out);
}

void ExcerptCopier::CopyCandidate(const Atlas& atlas, KeyframeHandle keyframe, KeyframeHandle query,
                                  GroupExcerpt* out) {
  Begin(atlas, keyframe, out);
  CollectGroup(atlas, keyframe, kWideGroup, config_.mapping.min_shared_points, &covisible_, &group_);
  const std::size_t num_near = std::min(group_.size(), static_cast<std::size_t>(config_.place.common_area.group_size));
  for (std::size_t i = 0; i < num_near; ++i) AddKeyframe(atlas, atlas.keyframe(group_[i]), out);
  out->num_searched = out->points.size();
  for (std::size_t i = num_near; i < group_.size(); ++i) AddPoints(atlas, atlas.keyframe(group_[i]), out);
  End(*out);
  const Keyframe& a = atlas.keyframe(query);
  const Keyframe& b = atlas.keyframe(keyframe);
  if (a.map == b.map) out->way = WayBetween(atlas, a, b);
}

}  // namespace haustra
