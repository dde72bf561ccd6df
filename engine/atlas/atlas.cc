#include "engine/atlas/atlas.h"

#include <algorithm>
#include <array>

namespace haustra {

Atlas::Atlas(const Capacity& capacity, std::pmr::memory_resource* memory)
    : keyframes_(static_cast<std::uint32_t>(capacity.max_keyframes), memory, capacity.max_features, memory),
      points_(static_cast<std::uint32_t>(capacity.max_map_points), memory),
      maps_(static_cast<std::uint32_t>(capacity.max_maps), memory, capacity.max_keyframes, memory),
      marks_(static_cast<std::uint32_t>(capacity.max_marks), memory),
      traces_(static_cast<std::size_t>(capacity.max_keyframe_ids), memory),
      max_features_(capacity.max_features),
      shared_counts_(static_cast<std::size_t>(capacity.max_keyframes), 0, memory) {}

MemoryPlan Atlas::PlanMemory(const Capacity& capacity) {
  const auto num_keyframes = static_cast<std::size_t>(capacity.max_keyframes);
  const auto num_points = static_cast<std::size_t>(capacity.max_map_points);
  const auto num_maps = static_cast<std::size_t>(capacity.max_maps);
  const auto num_ids = static_cast<std::size_t>(capacity.max_keyframe_ids);
  const std::size_t of_keyframe =
      FrameFeatures::BytesFor(capacity.max_features) + MemoryArena::BytesFor<MapPointHandle>(capacity.max_features);
  MemoryPlan plan;
  const auto add = [&plan](const char* pool, std::size_t count, std::size_t bytes, const char* sized_by) {
    plan.Add(MemoryPlace::kHostArena, pool, count, bytes, sized_by);
  };
  add("keyframes", num_keyframes,
      decltype(keyframes_)::BytesFor(num_keyframes) + num_keyframes * of_keyframe +
          MemoryArena::BytesFor<int>(num_keyframes),
      "memory.max_keyframes x features.max");
  add("map points", num_points, decltype(points_)::BytesFor(num_points), "memory.max_map_points");
  add("maps", num_maps,
      decltype(maps_)::BytesFor(num_maps) + num_maps * MemoryArena::BytesFor<KeyframeHandle>(num_keyframes),
      "memory.max_maps x memory.max_keyframes");
  const auto num_marks = static_cast<std::size_t>(capacity.max_marks);
  add("marks", num_marks, decltype(marks_)::BytesFor(num_marks), "memory.max_marks");
  add("keyframe traces", num_ids, MemoryArena::BytesFor<KeyframeTrace>(num_ids), "memory.max_keyframe_ids");
  return plan;
}

Atlas::Capacity Atlas::capacity() const {
  return {static_cast<int>(keyframes_.capacity()),
          static_cast<int>(points_.capacity()),
          static_cast<int>(maps_.capacity()),
          static_cast<int>(traces_.size()),
          max_features_,
          static_cast<int>(marks_.capacity())};
}

MapHandle Atlas::InsertMap(MapId id) {
  const MapHandle handle = maps_.Insert();
  if (!handle) return handle;
  Map& map = maps_.At(handle);
  map.id = id;
  map.status = MapStatus::kActive;
  map.merged_into = kNoId;
  map.is_loaded = false;
  map.keyframes.clear();  // keeps its memory
  map.num_points = 0;
  return handle;
}

MapHandle Atlas::CreateMap() {
  const MapHandle handle = InsertMap(next_map_id_);
  if (handle) ++next_map_id_;
  return handle;
}

void Atlas::DropMap(MapHandle handle, std::vector<FeatureSetHandle>* released) {
  HAUSTRA_CHECK(!HasMarks(handle));
  Map& map = maps_.At(handle);
  points_.ForEach([&](MapPointHandle point, MapPoint& value) {
    if (value.map == handle) points_.Release(point);
  });
  for (const KeyframeHandle keyframe : map.keyframes) {
    released->push_back(keyframes_.At(keyframe).features.set);
    traces_[keyframes_.At(keyframe).id].stand_in = kNoId;
    keyframes_.Release(keyframe);
  }
  map.keyframes.clear();
  map.num_points = 0;
  map.status = MapStatus::kDropped;
}

void Atlas::ForgetMap(MapHandle handle) {
  const Map& map = maps_.At(handle);
  HAUSTRA_CHECK(map.status == MapStatus::kDropped || map.status == MapStatus::kMerged);
  maps_.Release(handle);
}

KeyframeHandle Atlas::AddKeyframe(MapHandle map, std::uint32_t frame_index, TimePoint timestamp,
                                  const SE3& cam_from_map, const FrameFeatures& features) {
  if (next_keyframe_id_ >= traces_.size()) return {};
  const KeyframeHandle handle =
      InsertKeyframe(map, next_keyframe_id_, session_, frame_index, timestamp, cam_from_map, 1.0, features);
  if (handle) ++next_keyframe_id_;
  return handle;
}

KeyframeHandle Atlas::InsertKeyframe(MapHandle map, KeyframeId id, std::uint32_t session, std::uint32_t frame_index,
                                     TimePoint timestamp, const SE3& cam_from_map, double scale,
                                     const FrameFeatures& features) {
  HAUSTRA_CHECK(features.num <= max_features_);
  const KeyframeHandle handle = keyframes_.Insert();
  if (!handle) return handle;
  Keyframe& keyframe = keyframes_.At(handle);
  keyframe.id = id;
  keyframe.session = session;
  keyframe.frame_index = frame_index;
  keyframe.timestamp = timestamp;
  keyframe.map = map;
  keyframe.cam_from_map = cam_from_map;
  keyframe.features.set = features.set;
  keyframe.features.num = features.num;
  keyframe.features.is_reduced = features.is_reduced;
  std::copy_n(features.keypoints.begin(), features.num, keyframe.features.keypoints.begin());
  std::copy_n(features.bearings.begin(), features.num, keyframe.features.bearings.begin());
  std::fill(keyframe.points.begin(), keyframe.points.end(), MapPointHandle{});
  keyframe.num_points = 0;
  keyframe.num_point_changes = 0;
  keyframe.turned_at = 0;
  KeyframeTrace& trace = traces_[id];
  trace = KeyframeTrace{};
  trace.session = session;
  trace.frame_index = frame_index;
  trace.keyframe = handle;
  trace.scale = scale;
  maps_.At(map).keyframes.push_back(handle);
  return handle;
}

FeatureSetHandle Atlas::RemoveKeyframe(KeyframeHandle handle, KeyframeHandle stand_in) {
  Keyframe& keyframe = keyframes_.At(handle);
  const Keyframe& other = keyframes_.At(stand_in);
  for (int i = 0; i < keyframe.features.num; ++i) {
    const MapPointHandle point = keyframe.points[i];
    if (point && RemoveObservation(point, handle)) {
      // The descriptor must not name a set that goes away.
      if (points_.At(point).descriptor.set == keyframe.features.set) UpdatePoint(point);
    }
  }
  marks_.ForEach([&](MarkHandle mark, const Mark& value) {
    if (value.keyframe == handle) PlaceMark(mark, stand_in, PlaceOf(value));
  });
  KeyframeTrace& trace = traces_[keyframe.id];
  trace.stand_in = other.id;
  trace.cam_from_stand_in = keyframe.cam_from_map * other.cam_from_map.Inverse();
  trace.stand_in_scale = traces_[other.id].scale;
  trace.turned_at = keyframe.turned_at;
  auto& list = maps_.At(keyframe.map).keyframes;
  list.erase(std::find(list.begin(), list.end(), handle));
  const FeatureSetHandle set = keyframe.features.set;
  keyframes_.Release(handle);
  return set;
}

MapPointHandle Atlas::AddPoint(MapHandle map, const Eigen::Vector3d& position, KeyframeId made_by) {
  const MapPointHandle handle = InsertPoint(map, next_point_id_, position, made_by);
  if (handle) ++next_point_id_;
  return handle;
}

MapPointHandle Atlas::InsertPoint(MapHandle map, std::uint32_t id, const Eigen::Vector3d& position,
                                  KeyframeId made_by) {
  const MapPointHandle handle = points_.Insert();
  if (!handle) return handle;
  MapPoint& point = points_.At(handle);
  point.id = id;
  point.map = map;
  point.position = position;
  point.normal.setZero();
  point.scale_times_distance = 0.0;
  point.descriptor = DescriptorRef{};
  point.observations.Clear();
  point.first_keyframe_id = made_by;
  ++maps_.At(map).num_points;
  return handle;
}

void Atlas::RemovePoint(MapPointHandle handle) {
  MapPoint& point = points_.At(handle);
  for (const Observation& observation : point.observations) {
    Keyframe& keyframe = keyframes_.At(observation.keyframe);
    keyframe.points[observation.feature_idx] = MapPointHandle{};
    --keyframe.num_points;
    ++keyframe.num_point_changes;
  }
  --maps_.At(point.map).num_points;
  points_.Release(handle);
}

std::int32_t Atlas::FeatureOf(const MapPoint& point, KeyframeHandle keyframe) const {
  for (const Observation& observation : point.observations) {
    if (observation.keyframe == keyframe) return observation.feature_idx;
  }
  return -1;
}

bool Atlas::AddObservation(MapPointHandle handle, KeyframeHandle keyframe_handle, std::int32_t feature_idx) {
  MapPoint& point = points_.At(handle);
  Keyframe& keyframe = keyframes_.At(keyframe_handle);
  if (keyframe.points[feature_idx] || FeatureOf(point, keyframe_handle) >= 0) return false;
  const bool was_full = point.observations.full();
  if (was_full && !MakeObservationRoom(handle, {keyframe_handle, feature_idx})) return false;
  HAUSTRA_CHECK(point.observations.PushBack({keyframe_handle, feature_idx}));
  keyframe.points[feature_idx] = handle;
  ++keyframe.num_points;
  ++keyframe.num_point_changes;
  // The descriptor may have been that of the observation given up.
  if (was_full) UpdatePoint(handle);
  return true;
}

PointView Atlas::ViewOf(const Observation& observation) const {
  const Keyframe& keyframe = keyframes_.At(observation.keyframe);
  return {keyframe.id, keyframe.cam_from_map.InverseTranslation(),
          keyframe.features.keypoints[observation.feature_idx].scale_px};
}

bool Atlas::MakeObservationRoom(MapPointHandle handle, const Observation& wanted) {
  const MapPoint& point = points_.At(handle);
  std::array<PointView, kMaxObservations + 1> views;
  for (std::size_t i = 0; i < kMaxObservations; ++i) views[i] = ViewOf(point.observations[i]);
  views[kMaxObservations] = ViewOf(wanted);
  const int least = LeastWorthyView(views, point.position);
  if (least == kMaxObservations) {
    ++num_refused_observations_;
    return false;
  }
  ++num_replaced_observations_;
  RemoveObservation(handle, point.observations[static_cast<std::size_t>(least)].keyframe);
  return true;
}

bool Atlas::RemoveObservation(MapPointHandle handle, KeyframeHandle keyframe_handle) {
  MapPoint& point = points_.At(handle);
  for (std::size_t i = 0; i < point.observations.size(); ++i) {
    if (point.observations[i].keyframe != keyframe_handle) continue;
    Keyframe& keyframe = keyframes_.At(keyframe_handle);
    keyframe.points[point.observations[i].feature_idx] = MapPointHandle{};
    --keyframe.num_points;
    ++keyframe.num_point_changes;
    point.observations.SwapErase(i);
    break;
  }
  if (point.observations.size() < 2) {
    RemovePoint(handle);
    return false;
  }
  return true;
}

void Atlas::FusePoints(MapPointHandle from, MapPointHandle into) {
  MapPoint& source = points_.At(from);
  const FixedVector<Observation, kMaxObservations> observations = source.observations;
  RemovePoint(from);
  for (const Observation& observation : observations) {
    AddObservation(into, observation.keyframe, observation.feature_idx);
  }
  UpdatePoint(into);
}

void Atlas::UpdatePoint(MapPointHandle handle) {
  MapPoint& point = points_.At(handle);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::array<double, kMaxObservations> sizes;
  std::size_t num = 0;
  for (const Observation& observation : point.observations) {
    const Keyframe& keyframe = keyframes_.At(observation.keyframe);
    const Eigen::Vector3d to_camera = keyframe.cam_from_map.InverseTranslation() - point.position;
    const double distance = to_camera.norm();
    if (distance <= 0) continue;
    sum += to_camera / distance;
    sizes[num++] = keyframe.features.keypoints[observation.feature_idx].scale_px * distance;
  }
  if (num == 0) return;
  if (sum.norm() > 0) point.normal = sum.normalized();
  std::nth_element(sizes.begin(), sizes.begin() + num / 2, sizes.begin() + num);
  point.scale_times_distance = sizes[num / 2];
  // The newest view stands for the point: appearance under a moving light ages.
  const Observation* newest = point.observations.begin();
  for (const Observation& observation : point.observations) {
    if (keyframes_.At(observation.keyframe).id > keyframes_.At(newest->keyframe).id) newest = &observation;
  }
  point.descriptor = {keyframes_.At(newest->keyframe).features.set, newest->feature_idx};
}

MarkHandle Atlas::AddMark(const Mark& mark, KeyframeHandle keyframe, const PlacedMark& place) {
  const MarkHandle handle = marks_.Insert();
  if (!handle) return handle;
  Mark& added = marks_.At(handle);
  added = mark;
  added.id = next_mark_id_++;
  added.session = session_;
  PlaceMark(handle, keyframe, place);
  return handle;
}

void Atlas::RemoveMark(MarkHandle handle) { HAUSTRA_CHECK(marks_.Release(handle)); }

void Atlas::PlaceMark(MarkHandle handle, KeyframeHandle keyframe_handle, const PlacedMark& place) {
  const Keyframe& keyframe = keyframes_.At(keyframe_handle);
  HAUSTRA_CHECK(keyframe.map == place.map);
  Mark& mark = marks_.At(handle);
  mark.keyframe = keyframe_handle;
  mark.point_in_anchor = keyframe.cam_from_map * place.position;
  mark.normal_in_anchor = keyframe.cam_from_map.rotation * place.normal;
  mark.radius = place.radius;
  mark.scale = traces_[keyframe.id].scale;
}

PlacedMark Atlas::PlaceOf(const Mark& mark) const {
  const Keyframe& keyframe = keyframes_.At(mark.keyframe);
  // The map's unit may have changed since.
  const double growth = traces_[keyframe.id].scale / mark.scale;
  PlacedMark place;
  place.map = keyframe.map;
  place.position = keyframe.cam_from_map.Inverse() * (growth * mark.point_in_anchor);
  place.normal = keyframe.cam_from_map.rotation.conjugate() * mark.normal_in_anchor;
  place.radius = growth * mark.radius;
  return place;
}

MarkHandle Atlas::FindMark(std::string_view label) const {
  MarkHandle found;
  marks_.ForEach([&](MarkHandle handle, const Mark& mark) {
    if (mark.label.view() == label) found = handle;
  });
  return found;
}

bool Atlas::HasMarks(MapHandle map) const {
  bool has_marks = false;
  marks_.ForEach(
      [&](MarkHandle, const Mark& mark) { has_marks = has_marks || keyframes_.At(mark.keyframe).map == map; });
  return has_marks;
}

void Atlas::FindCovisible(KeyframeHandle handle, int min_shared, std::vector<Covisible>* out) const {
  out->clear();
  std::fill(shared_counts_.begin(), shared_counts_.end(), 0);
  const Keyframe& keyframe = keyframes_.At(handle);
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i]) continue;
    for (const Observation& observation : points_.At(keyframe.points[i]).observations) {
      if (observation.keyframe == handle) continue;
      if (shared_counts_[observation.keyframe.index]++ == 0) out->push_back({observation.keyframe, 0});
    }
  }
  for (Covisible& covisible : *out) covisible.num_shared = shared_counts_[covisible.keyframe.index];
  std::erase_if(*out, [&](const Covisible& c) { return c.num_shared < min_shared; });
  std::sort(out->begin(), out->end(), [&](const Covisible& a, const Covisible& b) {
    if (a.num_shared != b.num_shared) return a.num_shared > b.num_shared;
    return keyframes_.At(a.keyframe).id < keyframes_.At(b.keyframe).id;
  });
}

bool Atlas::Resolve(KeyframeId reference, const SE3& cam_from_reference, double reference_scale,
                    ResolvedPose* out) const {
  SE3 cam_from_keyframe = cam_from_reference;
  double scale = reference_scale;
  KeyframeId id = reference;
  std::uint64_t turned_at = 0;
  while (id != kNoId && id < next_keyframe_id_) {
    const KeyframeTrace& trace = traces_[id];
    if (const Keyframe* keyframe = keyframes_.Get(trace.keyframe); keyframe != nullptr && keyframe->id == id) {
      out->turned_at = std::max(turned_at, keyframe->turned_at);
      cam_from_keyframe.translation *= trace.scale / scale;
      out->map_id = maps_.At(keyframe->map).id;
      out->cam_from_map = cam_from_keyframe * keyframe->cam_from_map;
      return true;
    }
    // trace.scale of a culled keyframe stopped changing when it was culled, as stand_in_scale records.
    cam_from_keyframe.translation *= trace.scale / scale;
    cam_from_keyframe = cam_from_keyframe * trace.cam_from_stand_in;
    scale = trace.stand_in_scale;
    turned_at = std::max(turned_at, trace.turned_at);
    id = trace.stand_in;
  }
  return false;
}

KeyframeHandle Atlas::FindById(KeyframeId id) const {
  while (id != kNoId && id < next_keyframe_id_) {
    const KeyframeTrace& trace = traces_[id];
    if (const Keyframe* keyframe = keyframes_.Get(trace.keyframe); keyframe != nullptr && keyframe->id == id) {
      return trace.keyframe;
    }
    id = trace.stand_in;
  }
  return {};
}

void Atlas::TransformMap(MapHandle handle, const Sim3& new_from_old) {
  for (const KeyframeHandle keyframe_handle : maps_.At(handle).keyframes) {
    Keyframe& keyframe = keyframes_.At(keyframe_handle);
    keyframe.cam_from_map = TransformPose(keyframe.cam_from_map, new_from_old);
    traces_[keyframe.id].scale *= new_from_old.scale;
  }
  points_.ForEach([&](MapPointHandle, MapPoint& point) {
    if (point.map != handle) return;
    point.position = new_from_old * point.position;
    point.normal = new_from_old.rotation * point.normal;
    point.scale_times_distance *= new_from_old.scale;
  });
}

void Atlas::AbsorbMap(MapHandle into_handle, MapHandle from_handle) {
  HAUSTRA_CHECK(into_handle != from_handle);
  Map& into = maps_.At(into_handle);
  Map& from = maps_.At(from_handle);
  for (const KeyframeHandle keyframe : from.keyframes) keyframes_.At(keyframe).map = into_handle;
  points_.ForEach([&](MapPointHandle, MapPoint& point) {
    if (point.map == from_handle) point.map = into_handle;
  });
  // The list stays in order of insertion, which is the order of the ids.
  const auto middle = static_cast<std::ptrdiff_t>(into.keyframes.size());
  into.keyframes.insert(into.keyframes.end(), from.keyframes.begin(), from.keyframes.end());
  std::inplace_merge(into.keyframes.begin(), into.keyframes.begin() + middle, into.keyframes.end(),
                     [&](KeyframeHandle a, KeyframeHandle b) { return keyframes_.At(a).id < keyframes_.At(b).id; });
  into.num_points += from.num_points;
  if (from.status == MapStatus::kActive) into.status = MapStatus::kActive;
  from.keyframes.clear();
  from.num_points = 0;
  from.status = MapStatus::kMerged;
  from.merged_into = into.id;
}

void Atlas::CorrectKeyframe(KeyframeHandle handle, const SE3& cam_from_map, double scale) {
  Keyframe& keyframe = keyframes_.At(handle);
  keyframe.cam_from_map = cam_from_map;
  traces_[keyframe.id].scale *= scale;
}

void Atlas::RestoreCounters(const Counters& counters) {
  HAUSTRA_CHECK(next_keyframe_id_ == 0 && next_point_id_ == 0 && next_map_id_ == 0);
  HAUSTRA_CHECK(counters.next_keyframe_id <= traces_.size());
  next_keyframe_id_ = counters.next_keyframe_id;
  next_point_id_ = counters.next_point_id;
  next_map_id_ = counters.next_map_id;
  session_ = counters.session;
  next_mark_id_ = counters.next_mark_id;
}

MapHandle Atlas::RestoreMap(MapId id) {
  HAUSTRA_CHECK(id < next_map_id_);
  const MapHandle handle = InsertMap(id);
  Map& map = maps_.At(handle);
  map.status = MapStatus::kStored;
  map.is_loaded = true;
  return handle;
}

KeyframeHandle Atlas::RestoreKeyframe(MapHandle map, KeyframeId id, std::uint32_t session, std::uint32_t frame_index,
                                      TimePoint timestamp, const SE3& cam_from_map, double scale,
                                      const FrameFeatures& features) {
  HAUSTRA_CHECK(id < next_keyframe_id_ && session < session_);
  const KeyframeHandle handle = InsertKeyframe(map, id, session, frame_index, timestamp, cam_from_map, scale, features);
  HAUSTRA_CHECK(handle.is_valid());
  return handle;
}

void Atlas::RestoreTrace(KeyframeId id, const KeyframeTrace& trace) {
  HAUSTRA_CHECK(id < next_keyframe_id_ && !keyframes_.Contains(traces_[id].keyframe));
  traces_[id] = trace;
}

MapPointHandle Atlas::RestorePoint(MapHandle map, std::uint32_t id, const Eigen::Vector3d& position,
                                   KeyframeId made_by) {
  HAUSTRA_CHECK(id < next_point_id_);
  const MapPointHandle handle = InsertPoint(map, id, position, made_by);
  HAUSTRA_CHECK(handle.is_valid());
  return handle;
}

void Atlas::RestoreMark(const Mark& mark) {
  HAUSTRA_CHECK(mark.id < next_mark_id_ && keyframes_.Contains(mark.keyframe));
  const MarkHandle handle = marks_.Insert();
  HAUSTRA_CHECK(handle.is_valid());
  marks_.At(handle) = mark;
}

}  // namespace haustra
