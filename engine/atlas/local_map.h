// An immutable picture of the part of the active map that tracking needs: the window of keyframes around the newest one
// and their points. The mapper builds it (LocalMapBuilder) and publishes it through a LatestMailbox; the tracker reads
// it without waiting, and may miss any number of them: what happened is told by engine/tracking/map_reply.h. Fixed
// capacity. All poses and positions are in the frame of the map `map_id` as of `version`.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/atlas/handles.h"
#include "engine/geometry/se3.h"
#include "hal/core/fixed_vector.h"
#include "hal/core/time.h"

namespace haustra {

// As many as a point's mask has bits.
inline constexpr int kMaxLocalKeyframes = 64;

// A point seen in so many keyframes is there: not seeing it where it should be says something about the frame. In a
// snapshot of fewer keyframes, one seen in all.
inline constexpr int kEstablishedViews = 3;

struct LocalKeyframe {
  KeyframeHandle handle;
  KeyframeId id = kNoId;
  TimePoint taken;  // TimePoint::min(): in an earlier session
  SE3 cam_from_map;
  double scale = 1.0;                                  // of its map so far, see KeyframeTrace
  int num_points = 0;                                  // in this snapshot
  int num_established = 0;                             // of these, those that are established
  bool is_reduced = false;                             // see FrameFeatures
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  // of the points it sees, map frame
};

struct LocalPoint {
  MapPointHandle handle;
  Eigen::Vector3d position;
  Eigen::Vector3d normal;
  double scale_times_distance = 0.0;
  DescriptorRef descriptor;
  std::uint64_t keyframe_mask = 0;           // bit i: seen by keyframes[i]
  TimePoint established = TimePoint::max();  // by the keyframes that is_established asks for; max: not
};

// A mark of the map, wherever in it.
struct LocalMark {
  MarkId id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

struct LocalMap {
  LocalMap() = default;
  explicit LocalMap(int max_points, std::pmr::memory_resource* memory = std::pmr::get_default_resource())
      : points(static_cast<std::size_t>(max_points), memory) {}
  // What one takes from its arena.
  static std::size_t BytesFor(int max_points) { return MemoryArena::BytesFor<LocalPoint>(max_points); }

  std::uint64_t version = 0;  // 0: nothing published yet
  MapId map_id = kNoId;
  FixedVector<LocalKeyframe, kMaxLocalKeyframes> keyframes;  // the centre first
  int num_points = 0;
  std::pmr::vector<LocalPoint> points;      // [0, num_points), in order of handle.index
  FixedVector<LocalMark, kMaxMarks> marks;  // all of the map

  bool is_established(const LocalPoint& point) const {
    return std::popcount(point.keyframe_mask) >= std::min(kEstablishedViews, static_cast<int>(keyframes.size()));
  }
  // Fewer keyframes than a map needs to be kept; or as few of them around here.
  bool is_young(int min_map_keyframes) const { return static_cast<int>(keyframes.size()) < min_map_keyframes; }
  // Position of the point in `points`, -1: not in this snapshot.
  int Find(MapPointHandle handle) const;
};

// Fills `out` with the window around `centre`: its covisible keyframes, theirs, then keyframes that stand near and look
// the same way; at most kMaxLocalKeyframes, and points of the nearest keyframes first until `out->points` is full: the
// others are left out, and the snapshot is counted.
class LocalMapBuilder {
 public:
  explicit LocalMapBuilder(int max_keyframes, int max_map_points);

  // Sets keyframes and points of `out`; the other fields are the caller's.
  void Build(const Atlas& atlas, KeyframeHandle centre, LocalMap* out);

  // Snapshots that lack points of their window.
  std::uint64_t num_cut() const { return num_cut_; }

 private:
  void AddKeyframe(const Atlas& atlas, KeyframeHandle handle, LocalMap* out);
  bool AddPoints(const Atlas& atlas, LocalMap* out);

  std::vector<std::uint8_t> has_keyframe_;  // by keyframe slot
  std::vector<std::int32_t> point_slots_;   // by point slot: position in out->points, -1
  std::vector<Covisible> covisible_;
  std::vector<Covisible> second_ring_;
  std::uint64_t num_cut_ = 0;
};

}  // namespace haustra
