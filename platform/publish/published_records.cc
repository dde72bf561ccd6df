#include "platform/publish/published_records.h"

#include <algorithm>
#include <array>
#include <span>
#include <string_view>

namespace haustra {
namespace {

// The C header cannot include the engine's enumerations, so it repeats them.
static_assert(static_cast<int>(TrackingState::kInitialising) == HAUSTRA_STATE_INITIALISING);
static_assert(static_cast<int>(TrackingState::kTracking) == HAUSTRA_STATE_TRACKING);
static_assert(static_cast<int>(TrackingState::kLost) == HAUSTRA_STATE_LOST);
static_assert(static_cast<int>(MapEventKind::kMapCreated) == HAUSTRA_EVENT_MAP_CREATED);
static_assert(static_cast<int>(MapEventKind::kMerged) == HAUSTRA_EVENT_MERGED);
static_assert(static_cast<int>(MapEventKind::kMapEvicted) == HAUSTRA_EVENT_MAP_EVICTED);
static_assert(kNoId == HAUSTRA_NO_MAP);
static_assert(static_cast<int>(MarkState::kOutOfView) == HAUSTRA_MARK_OUT_OF_VIEW);
static_assert(static_cast<int>(MarkState::kInFront) == HAUSTRA_MARK_IN_FRONT);
static_assert(static_cast<int>(MarkState::kHidden) == HAUSTRA_MARK_HIDDEN);
static_assert(static_cast<int>(MarkState::kUnsure) == HAUSTRA_MARK_UNSURE);
static_assert(kMaxMarks == HAUSTRA_MAX_MARKS && kMaxMarkLabelBytes + 1 == HAUSTRA_MARK_LABEL_BYTES);

// The engine's reasons may be reordered, the published numbers may not: they are joined by name.
constexpr std::size_t kMaxReasons = 64;
const std::array<std::uint8_t, kMaxReasons> kReasonNumbers = [] {
  std::array<std::uint8_t, kMaxReasons> numbers{};
  for (std::size_t i = 0; i < kMaxReasons; ++i) {
    const std::string_view name = ToString(static_cast<TrackingReason>(i));
    while (numbers[i] < kMaxReasons && name != haustra_reason_name(numbers[i])) ++numbers[i];
  }
  return numbers;
}();

std::int64_t Nanoseconds(TimePoint time) { return time.time_since_epoch().count(); }

haustra_point Point(const Eigen::Vector3d& position, std::uint32_t id) {
  return {{static_cast<float>(position.x()), static_cast<float>(position.y()), static_cast<float>(position.z())}, id};
}

// An even selection of at most `capacity`, in order. Returns how many.
std::uint32_t Select(std::span<const haustra_point> from, std::size_t capacity, haustra_point* to) {
  const std::size_t count = std::min(from.size(), capacity);
  for (std::size_t i = 0; i < count; ++i) to[i] = from[i * from.size() / count];
  return static_cast<std::uint32_t>(count);
}

}  // namespace

haustra_pose PoseRecord(const FrameResult& result, const MarkSightings& marks, TimePoint captured, TimePoint now,
                        std::uint64_t procedure) {
  haustra_pose pose{};
  pose.captured_ns = Nanoseconds(captured);
  pose.published_ns = Nanoseconds(now);
  pose.source_ns = Nanoseconds(result.timestamp);
  pose.frame_index = result.frame_index;
  pose.procedure = procedure;
  pose.map_epoch = result.map_epoch;
  pose.map_id = result.map_id;
  pose.state = static_cast<std::uint32_t>(result.state);
  pose.reason = kReasonNumbers[static_cast<std::size_t>(result.reason)];
  pose.num_features = static_cast<std::uint32_t>(std::max(0, result.num_features));
  pose.num_inliers = static_cast<std::uint32_t>(std::max(0, result.num_inliers));
  if (result.is_keyframe) pose.flags |= HAUSTRA_POSE_KEYFRAME;
  if (result.state != TrackingState::kTracking) return pose;
  pose.flags |= HAUSTRA_POSE_VALID;
  if (pose.reason == HAUSTRA_REASON_PREDICTED) pose.flags |= HAUSTRA_POSE_PREDICTED;
  const SE3 map_from_cam = result.cam_from_map.Inverse();
  Eigen::Map<Eigen::Vector3d>(pose.position_mu) = map_from_cam.translation;
  Eigen::Map<Eigen::Vector4d>(pose.orientation_xyzw) = map_from_cam.rotation.coeffs();
  for (const MarkSighting& mark : marks) {
    pose.marks[pose.num_marks++] = {
        mark.id, static_cast<std::uint32_t>(mark.state), mark.u_px, mark.v_px, mark.distance_in_depths, 0};
  }
  return pose;
}

haustra_event EventRecord(const MapEvent& event, TimePoint now, std::uint64_t procedure) {
  haustra_event record{};
  record.published_ns = Nanoseconds(now);
  record.frame_index = event.frame_index;
  record.procedure = procedure;
  record.kind = static_cast<std::uint32_t>(event.kind);
  record.map_id = event.map_id;
  record.other_map_id = event.other_map_id;
  record.num_keyframes = static_cast<std::uint32_t>(std::max(0, event.num_keyframes));
  record.num_points = static_cast<std::uint32_t>(std::max(0, event.num_points));
  record.num_inliers =
      static_cast<std::uint32_t>(std::max({0, event.place.num_inliers, event.relocalisation.num_inliers}));
  return record;
}

void FillSnapshot(const Engine& engine, TimePoint now, std::uint64_t procedure, std::vector<haustra_point>* points,
                  haustra_snapshot* snapshot) {
  const Atlas& atlas = engine.atlas();
  snapshot->published_ns = Nanoseconds(now);
  snapshot->procedure = procedure;
  snapshot->map_epoch = engine.mapper_counters().num_reframings;
  snapshot->map_id = HAUSTRA_NO_MAP;
  snapshot->num_points = snapshot->num_map_points = snapshot->num_maps = 0;
  snapshot->num_keyframes = snapshot->num_map_keyframes = 0;
  snapshot->num_marks = 0;
  atlas.marks().ForEach([&](MarkHandle, const Mark& mark) {
    const PlacedMark place = atlas.PlaceOf(mark);
    haustra_mark& record = snapshot->marks[snapshot->num_marks++];
    record = {};
    record.id = mark.id;
    record.map_id = atlas.map(place.map).id;
    record.session = mark.session;
    record.frame_index = mark.frame_index;
    Eigen::Map<Eigen::Vector3f>(record.position_mu) = place.position.cast<float>();
    std::copy(mark.label.bytes().begin(), mark.label.bytes().end(), record.label);
  });
  MapHandle active;
  atlas.maps().ForEach([&](MapHandle handle, const Map& map) {
    if (map.keyframes.empty()) return;
    ++snapshot->num_maps;
    if (map.status == MapStatus::kActive) active = handle;
  });
  if (!active) return;
  const Map& map = atlas.map(active);
  snapshot->map_id = map.id;

  points->clear();
  for (const KeyframeHandle handle : map.keyframes) {
    const Keyframe& keyframe = atlas.keyframe(handle);
    points->push_back(Point(keyframe.cam_from_map.Inverse().translation, keyframe.id));
  }
  snapshot->num_map_keyframes = static_cast<std::uint32_t>(points->size());
  snapshot->num_keyframes = Select(*points, HAUSTRA_SNAPSHOT_KEYFRAMES, snapshot->keyframes);

  points->clear();
  atlas.points().ForEach([&](MapPointHandle, const MapPoint& point) {
    if (point.map == active) points->push_back(Point(point.position, point.id));
  });
  snapshot->num_map_points = static_cast<std::uint32_t>(points->size());
  snapshot->num_points = Select(*points, HAUSTRA_SNAPSHOT_POINTS, snapshot->points);
}

}  // namespace haustra
