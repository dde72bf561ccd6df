// The atlas: all maps with their keyframes and map points, in pools of fixed size, joined by handles.
// Every connection is kept in both directions (keyframe.points and point.observations) by the methods of Atlas alone.
// Covisibility is counted from the observations when it is asked for, so it can never be out of date.
// thread-bound(mapping): the one writer; everybody else reads LocalMap snapshots (local_map.h).
// Lengths are map units (monocular scale, no metric meaning). The entities are those of Campos et al. 2021.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <span>
#include <string_view>
#include <vector>

#include "engine/atlas/frame_features.h"
#include "engine/atlas/handles.h"
#include "engine/atlas/mark.h"
#include "engine/atlas/view_choice.h"
#include "engine/geometry/sim3.h"
#include "hal/core/fixed_vector.h"
#include "hal/core/memory_plan.h"
#include "hal/core/slot_pool.h"
#include "hal/core/time.h"
#include "hal/vision_device.h"

namespace haustra {

// Pools and what happens when they are full:
//   keyframes, map points, maps   Add and Create return an invalid handle; the mapper makes room before it asks
//                                 (engine/mapping/evictor.h) and counts what it could not have
//   observations of a point       the one worth least is given up (view_choice.h); when that is the new one itself, it
//                                 is refused and counted (num_refused_observations)
//   keyframe traces               AddKeyframe returns an invalid handle: ids are never used again within a run
//   marks                         AddMark returns an invalid handle: what a doctor has set goes only when it is removed
// A handle whose entity has gone is stale: Get* answers nullptr, and every other use stops the process, in every build.
struct Observation {
  KeyframeHandle keyframe;
  std::int32_t feature_idx = -1;
};

// Forty views say where a point is.
inline constexpr int kMaxObservations = 40;

struct MapPoint {
  std::uint32_t id = 0;
  MapHandle map;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // map frame
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    // mean direction from the point to its observers, unit
  double scale_times_distance =
      0.0;                   // keypoint scale (px) times distance: the size of what is seen, over the focal length
  DescriptorRef descriptor;  // of the youngest observation
  FixedVector<Observation, kMaxObservations> observations;
  KeyframeId first_keyframe_id = 0;  // keyframe whose insertion made it
};

struct Keyframe {
  Keyframe() = default;
  Keyframe(int max_features, std::pmr::memory_resource* memory)
      : features(max_features, memory), points(static_cast<std::size_t>(max_features), memory) {}

  KeyframeId id = 0;
  // Number of the run that made it. Frame index and time stamp are unique within one session only.
  std::uint32_t session = 0;
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  MapHandle map;
  SE3 cam_from_map;
  FrameFeatures features;
  std::pmr::vector<MapPointHandle> points;  // one a feature, invalid where there is none
  int num_points = 0;
  // Of `points`, since the keyframe was made: the same number, the same points.
  std::uint64_t num_point_changes = 0;
  // Number of the reframing by which its map was last built anew (engine/mapping/relief_check.h); 0: never. What was
  // measured around it by other poses, at another number, is of another shape.
  std::uint64_t turned_at = 0;
};

enum class MapStatus : std::uint8_t { kActive, kStored, kMerged, kDropped };

// Stays in the table when it is dropped or merged, until the table is full (ForgetMap); only active and stored maps
// hold keyframes.
struct Map {
  Map() = default;
  Map(int max_keyframes, std::pmr::memory_resource* memory) : keyframes(memory) {
    keyframes.reserve(static_cast<std::size_t>(max_keyframes));
  }

  MapId id = 0;
  MapStatus status = MapStatus::kActive;
  MapId merged_into = kNoId;
  bool is_loaded = false;                      // came out of a file
  std::pmr::vector<KeyframeHandle> keyframes;  // in order of insertion
  int num_points = 0;
};

// Where a keyframe that was culled went: its pose relative to the neighbour that stands in for it.
struct KeyframeTrace {
  std::uint32_t session = 0;
  std::uint32_t frame_index = 0;
  KeyframeHandle keyframe;      // alive, or stale and then:
  KeyframeId stand_in = kNoId;  // follow this one (kNoId: its map was dropped)
  SE3 cam_from_stand_in;
  double stand_in_scale = 1.0;  // unit of that translation
  double scale = 1.0;           // product of all scale changes of the keyframe's map so far (while alive)
  std::uint64_t turned_at = 0;  // Keyframe::turned_at when it went
};

struct ResolvedPose {
  MapId map_id = kNoId;
  SE3 cam_from_map;
  // The latest Keyframe::turned_at of those it was resolved by.
  std::uint64_t turned_at = 0;
};

struct Covisible {
  KeyframeHandle keyframe;
  int num_shared = 0;
};

class Atlas {
 public:
  struct Capacity {
    int max_keyframes = 0;
    int max_map_points = 0;
    int max_maps = 0;
    int max_keyframe_ids = 0;
    int max_features = 0;
    int max_marks = 0;
  };

  // Where the numbering goes on after the atlas was read from a file.
  struct Counters {
    KeyframeId next_keyframe_id = 0;
    std::uint32_t next_point_id = 0;
    MapId next_map_id = 0;
    std::uint32_t session = 0;
    MarkId next_mark_id = 0;
  };

  // Takes all its memory here.
  explicit Atlas(const Capacity& capacity, std::pmr::memory_resource* memory = std::pmr::get_default_resource());
  // A line a pool; the sum is what construction takes from an arena.
  static MemoryPlan PlanMemory(const Capacity& capacity);

  Capacity capacity() const;
  Counters counters() const { return {next_keyframe_id_, next_point_id_, next_map_id_, session_, next_mark_id_}; }
  // Number of this run; keyframes that were loaded are of earlier ones.
  std::uint32_t session() const { return session_; }

  // A new active map; an invalid handle when the pool is full.
  MapHandle CreateMap();
  // Removes all keyframes and points of the map; feature sets of its keyframes are appended to `released`. Never a map
  // with marks (HasMarks).
  void DropMap(MapHandle map, std::vector<FeatureSetHandle>* released);
  // Takes a map that was dropped or merged out of the table, so that another one can be made. Its id is not used again.
  void ForgetMap(MapHandle map);
  Map& map(MapHandle handle) { return maps_.At(handle); }
  const Map& map(MapHandle handle) const { return maps_.At(handle); }
  const SlotPool<Map, MapTag>& maps() const { return maps_; }

  // Copies features and takes over the feature set. Invalid handle when a pool is full.
  KeyframeHandle AddKeyframe(MapHandle map, std::uint32_t frame_index, TimePoint timestamp, const SE3& cam_from_map,
                             const FrameFeatures& features);
  // Points that lose their last but one observation go too. `stand_in`, of the same map, takes over frames that refer
  // to this keyframe, and its marks. Returns the feature set, which the caller releases when no reader can hold a
  // reference to it.
  FeatureSetHandle RemoveKeyframe(KeyframeHandle handle, KeyframeHandle stand_in);
  Keyframe* GetKeyframe(KeyframeHandle handle) { return keyframes_.Get(handle); }
  const Keyframe* GetKeyframe(KeyframeHandle handle) const { return keyframes_.Get(handle); }
  Keyframe& keyframe(KeyframeHandle handle) { return keyframes_.At(handle); }
  const Keyframe& keyframe(KeyframeHandle handle) const { return keyframes_.At(handle); }
  double KeyframeScale(KeyframeHandle handle) const { return traces_[keyframes_.At(handle).id].scale; }

  // Invalid handle when the pool is full.
  MapPointHandle AddPoint(MapHandle map, const Eigen::Vector3d& position, KeyframeId made_by);
  void RemovePoint(MapPointHandle handle);
  MapPoint* GetPoint(MapPointHandle handle) { return points_.Get(handle); }
  const MapPoint* GetPoint(MapPointHandle handle) const { return points_.Get(handle); }
  MapPoint& point(MapPointHandle handle) { return points_.At(handle); }
  const MapPoint& point(MapPointHandle handle) const { return points_.At(handle); }

  // False when the feature already has a point, the keyframe already observes the point, or the list is full of
  // observations that are worth more. When another one is given up for it the point is updated, too.
  bool AddObservation(MapPointHandle point, KeyframeHandle keyframe, std::int32_t feature_idx);
  // Removes the connection; the point goes when fewer than two are left (returns false then).
  bool RemoveObservation(MapPointHandle point, KeyframeHandle keyframe);
  // Feature of the keyframe that observes the point, -1: none.
  std::int32_t FeatureOf(const MapPoint& point, KeyframeHandle keyframe) const;
  // Hands all observations of `from` to `into` (where the keyframe does not observe `into` yet) and removes `from`.
  void FusePoints(MapPointHandle from, MapPointHandle into);
  // Normal, size and descriptor from the observations; call after they or the poses changed.
  void UpdatePoint(MapPointHandle handle);

  // Takes over label, frame and time; the place is in the frame of `keyframe`'s map. Invalid handle when the pool is
  // full.
  MarkHandle AddMark(const Mark& mark, KeyframeHandle keyframe, const PlacedMark& place);
  void RemoveMark(MarkHandle handle);
  // A better measurement, which the same or another keyframe of its map holds from now on.
  void PlaceMark(MarkHandle handle, KeyframeHandle keyframe, const PlacedMark& place);
  PlacedMark PlaceOf(const Mark& mark) const;
  MarkHandle FindMark(std::string_view label) const;  // invalid: there is none
  bool HasMarks(MapHandle map) const;
  const SlotPool<Mark, MarkTag>& marks() const { return marks_; }

  // Keyframes that share at least `min_shared` points with this one, most first (ties: older first).
  void FindCovisible(KeyframeHandle handle, int min_shared, std::vector<Covisible>* out) const;

  // Final pose of a frame that was tracked relative to a keyframe: follows stand-ins and scale changes.
  // False when its map was dropped.
  bool Resolve(KeyframeId reference, const SE3& cam_from_reference, double reference_scale, ResolvedPose* out) const;
  // Number of keyframe ids given so far, and the frame that each was made from.
  KeyframeId num_keyframe_ids() const { return next_keyframe_id_; }
  std::uint32_t FrameOfKeyframe(KeyframeId id) const { return traces_[id].frame_index; }
  double ScaleOfKeyframe(KeyframeId id) const { return traces_[id].scale; }
  bool IsOfThisSession(KeyframeId id) const { return traces_[id].session == session_; }
  const KeyframeTrace& TraceOfKeyframe(KeyframeId id) const { return traces_[id]; }
  // Handle of the keyframe with this id, or of the one that stands in for it; invalid when its map was dropped.
  KeyframeHandle FindById(KeyframeId id) const;

  // Moves a whole map into another frame of reference.
  void TransformMap(MapHandle map, const Sim3& new_from_old);
  // Hands all keyframes and points of `from` to `into`; both are in one frame of reference already (TransformMap).
  // `from` stays in the table as merged and empty; `into` is the active map when either was. Handles, traces and scales
  // stay as they are, so frames that refer to keyframes of `from` resolve into `into` from now on.
  void AbsorbMap(MapHandle into, MapHandle from);
  // A new pose for one keyframe around which the map's unit changed by `scale` (new per old), as a pose graph finds it;
  // frames that refer to the keyframe follow. Points are the caller's.
  void CorrectKeyframe(KeyframeHandle handle, const SE3& cam_from_map, double scale);

  // For engine/io/atlas_reader.h: puts back what was saved, ids and all, into an atlas that has never held anything.
  // Counters first, then maps (stored, marked as loaded), keyframes in order of their ids, traces of those that were
  // culled, points, marks; observations by AddObservation. The caller has checked ids and capacities: Restore* cannot
  // fail.
  void RestoreCounters(const Counters& counters);
  MapHandle RestoreMap(MapId id);
  KeyframeHandle RestoreKeyframe(MapHandle map, KeyframeId id, std::uint32_t session, std::uint32_t frame_index,
                                 TimePoint timestamp, const SE3& cam_from_map, double scale,
                                 const FrameFeatures& features);
  void RestoreTrace(KeyframeId id, const KeyframeTrace& trace);
  MapPointHandle RestorePoint(MapHandle map, std::uint32_t id, const Eigen::Vector3d& position, KeyframeId made_by);
  void RestoreMark(const Mark& mark);  // its keyframe is there

  const SlotPool<Keyframe, KeyframeTag>& keyframes() const { return keyframes_; }
  const SlotPool<MapPoint, MapPointTag>& points() const { return points_; }
  std::uint64_t num_refused_observations() const { return num_refused_observations_; }
  // Given up for others.
  std::uint64_t num_replaced_observations() const { return num_replaced_observations_; }

 private:
  PointView ViewOf(const Observation& observation) const;
  bool MakeObservationRoom(MapPointHandle point, const Observation& wanted);
  MapHandle InsertMap(MapId id);
  KeyframeHandle InsertKeyframe(MapHandle map, KeyframeId id, std::uint32_t session, std::uint32_t frame_index,
                                TimePoint timestamp, const SE3& cam_from_map, double scale,
                                const FrameFeatures& features);
  MapPointHandle InsertPoint(MapHandle map, std::uint32_t id, const Eigen::Vector3d& position, KeyframeId made_by);

  SlotPool<Keyframe, KeyframeTag> keyframes_;
  SlotPool<MapPoint, MapPointTag> points_;
  SlotPool<Map, MapTag> maps_;
  SlotPool<Mark, MarkTag> marks_;
  std::pmr::vector<KeyframeTrace> traces_;  // by keyframe id
  int max_features_;
  KeyframeId next_keyframe_id_ = 0;
  std::uint32_t next_point_id_ = 0;
  MapId next_map_id_ = 0;
  MarkId next_mark_id_ = 0;
  std::uint32_t session_ = 0;
  std::uint64_t num_refused_observations_ = 0;
  std::uint64_t num_replaced_observations_ = 0;
  mutable std::pmr::vector<int> shared_counts_;  // workspace of FindCovisible, by keyframe slot
};

}  // namespace haustra
