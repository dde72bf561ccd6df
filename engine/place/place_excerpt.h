// What verification (common_area.h) reads of the atlas, copied: a keyframe with those around it and the points that
// they show. A copy stays as it is while the mapper goes on changing the atlas, so verification may run on any thread.
// The feature sets that it names stay on the device until whoever holds the copy is done (mapper.h).
//
// Capacity fixed at construction. A keyframe's own points and those of its group always fit; of the points of the wider
// group, which only neighbours are searched for, those without room are left out and counted.
#pragma once

#include <array>
#include <cstdint>
#include <memory_resource>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/config.h"
#include "engine/place/place_config.h"
#include "engine/place/projected_search.h"

namespace haustra {

struct KeyframeExcerpt {
  KeyframeExcerpt(int max_features, std::pmr::memory_resource* memory)
      : keypoints(static_cast<std::size_t>(max_features), memory),
        points(static_cast<std::size_t>(max_features), memory) {}
  static std::size_t BytesFor(int max_features) {
    return MemoryArena::BytesFor<Keypoint>(max_features) + MemoryArena::BytesFor<std::int32_t>(max_features);
  }

  Eigen::Vector2d pixel(int i) const { return {keypoints[i].x_px, keypoints[i].y_px}; }

  SE3 cam_from_map;
  FeatureSetHandle set;
  std::int32_t num = 0;                   // features
  std::pmr::vector<Keypoint> keypoints;   // [0, num)
  std::pmr::vector<std::int32_t> points;  // [0, num): position in the points of the group, -1: none
};

// How one keyframe saw a point.
struct PointSight {
  SE3 cam_from_map;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double scale_px = 0.0;
};

struct GroupExcerpt {
  struct Capacity {
    int keyframes = 0;
    int features = 0;
    int points = 0;
    bool has_sights = false;
  };
  GroupExcerpt(const Capacity& capacity, std::pmr::memory_resource* memory);
  static std::size_t BytesFor(const Capacity& capacity);
  // Of the new keyframe and the neighbours that are to confirm it; of a candidate.
  static Capacity ForQuery(const EngineConfig& config);
  static Capacity ForCandidate(const EngineConfig& config);

  const KeyframeExcerpt& first() const { return keyframes.front(); }
  std::span<const SearchedPoint> searched() const { return std::span(points).first(num_searched); }

  KeyframeHandle keyframe;  // the first one
  KeyframeId id = kNoId;
  MapId map_id = kNoId;
  double scale = 1.0;  // of its map (Atlas::KeyframeScale)
  int num_points = 0;  // of its features that have one
  int num_keyframes = 0;
  std::pmr::vector<KeyframeExcerpt> keyframes;  // [0, num_keyframes)
  // In order of keyframe and feature, each once; at most as many as were reserved.
  std::pmr::vector<SearchedPoint> points;
  std::pmr::vector<MapPointHandle> handles;  // of points
  std::pmr::vector<PointSight> sights;       // candidate only: of points, each by one observer
  std::size_t num_searched = 0;              // of points: those to be found on the other side, which come first
  double way = 0.0;  // candidate in the map of the query only: of the scope, from one to the other
};

// thread-bound(mapping).
class ExcerptCopier {
 public:
  // The configuration outlives it.
  explicit ExcerptCopier(const EngineConfig& config);

  // Searched are the keyframe's own points; behind it come its best covisible keyframes.
  void CopyQuery(const Atlas& atlas, KeyframeHandle keyframe, GroupExcerpt* out);
  // Searched are the points of the group; the points of the wider group follow.
  void CopyCandidate(const Atlas& atlas, KeyframeHandle keyframe, KeyframeHandle query, GroupExcerpt* out);

  std::uint64_t num_points_left_out() const { return num_points_left_out_; }

 private:
  void Begin(const Atlas& atlas, KeyframeHandle keyframe, GroupExcerpt* out);
  void AddPoints(const Atlas& atlas, const Keyframe& keyframe, GroupExcerpt* out);
  void AddKeyframe(const Atlas& atlas, const Keyframe& keyframe, GroupExcerpt* out);
  void End(const GroupExcerpt& out);

  const EngineConfig& config_;
  std::vector<std::int32_t> index_of_;  // by point slot, -1: not in the excerpt that is being made
  std::vector<KeyframeHandle> group_;
  std::vector<Covisible> covisible_;
  std::uint64_t num_points_left_out_ = 0;
};

}  // namespace haustra
