// What happens when a pool of the atlas is full. Room is made in this order, until there is enough:
//   keyframes   1. the least useful keyframe of the inactive maps, as long as others see most of its points
//               2. the same of the active map, but for the tracker's surroundings
//               3. the smallest inactive map with at most memory.small_map_keyframes, as a whole
//               4. the least useful keyframe of any map, but for the tracker's surroundings, whoever sees its points
//               5. nothing is left that may go: the caller refuses the new keyframe
//               1, 2 and 4 leave mapping.min_map_keyframes to every map
//   map points  1. points of inactive maps with few observations; 2. whole small inactive maps, as above; 3. points of
//               the active map with two observations; 4. any of inactive maps; 5. any of the active map; 6. refused.
//               None goes that the tracker's surroundings see; 1 and 3 spare places with hardly any points
//   maps        1. the table's entry of the oldest map that was dropped, then of the oldest that was merged (they hold
//                  nothing but their place in the table); 2. the smallest inactive map with its entry; 3. refused
// A map in which a doctor has set a mark never goes as a whole, and a keyframe that goes hands its marks on.
// Useful is a keyframe whose points few others see: it is the number of its points with at most kFewViews observations,
// ties: the older goes first. Useful is a point that many see; of others the one whose thinnest keyframe has fewest
// points left: places are thinned out evenly, and those with hardly any points keep them till last. Frames that were
// tracked against a keyframe which goes are resolved through the neighbour that shares most points with it, else the
// next in its map: a map that is thinned out loses no frame; one that is dropped does. A batch goes at a time, so that
// the search is not made for every new keyframe. Deterministic. thread-bound(mapping), between two steps of anything
// that holds handles.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/config.h"
#include "engine/place/retrieval.h"

namespace haustra {

struct EvictionCounters {
  std::uint64_t num_keyframes = 0;    // one by one
  std::uint64_t num_maps = 0;         // as a whole
  std::uint64_t num_map_entries = 0;  // of the table, used again
  std::uint64_t num_points = 0;       // one by one
};

class Evictor {
 public:
  // A point with more observations than this is established without any one of its keyframes.
  static constexpr std::size_t kFewViews = 3;

  // `release` takes the feature set of every keyframe that goes; `report` hears of every whole map before it goes.
  // Everything named outlives it.
  Evictor(const EngineConfig& config, Atlas& atlas, KeyframeRetrieval& retrieval,
          std::function<void(FeatureSetHandle)> release, std::function<void(MapHandle)> report);

  // Makes room for `wanted` entries; false when too little could go. `newest` (may be invalid) and the keyframes that
  // share points with it stay.
  bool MakeKeyframeRoom(int wanted, KeyframeHandle newest);
  // At most a quarter of the pool.
  bool MakePointRoom(int wanted, KeyframeHandle newest);
  bool MakeMapRoom();
  // Whether a new map finds room once tracking has left the active one, which is stored then, or dropped when it is too
  // small to be kept: its entry, and `wanted` keyframes with their ids. Nothing goes. Where they say so, room can be
  // made. For keyframes they may say no where a map that is thinned out first would be small enough to be dropped.
  bool HasMapRoom() const;
  bool HasKeyframeRoom(int wanted) const;

  const EvictionCounters& counters() const { return counters_; }

 private:
  // A point's rank says when it goes, the smallest first. Classes are those of the list above; in each, those with few
  // observations go first, and of these the ones whose thinnest keyframe has most points left.
  enum RankClass { kFewOfInactive, kTwoOfActive, kAnyOfInactive, kAnyOfActive, kNumRankClasses };
  static constexpr int kRichnessSteps = 32;
  static constexpr int kRanksOfClass = 2 * (kMaxObservations + 1) * kRichnessSteps;
  static constexpr int kNumRanks = kNumRankClasses * kRanksOfClass;

  struct Candidate {
    int num_own = 0;  // points that few others see
    KeyframeId id = kNoId;
    KeyframeHandle keyframe;
    auto operator<=>(const Candidate&) const = default;
  };

  int NumFreeKeyframes() const;
  int NumFreePoints() const;
  void Protect(KeyframeHandle newest);
  int NumOwnPoints(const Keyframe& keyframe) const;
  bool IsInactive(const Map& map) const { return map.status == MapStatus::kStored; }
  // Keyframes of maps that are inactive or not, of whose points at most `max_own_share` are their own.
  enum class Which { kInactive, kActive, kAll };
  void EvictKeyframes(int wanted, Which which, double max_own_share);
  void EvictKeyframe(KeyframeHandle handle);
  bool EvictSmallestMap(int max_keyframes);
  // In [0, kNumRanks); negative: it stays.
  int RankOf(const MapPoint& point) const;
  void CountRanks();
  // After CountRanks: until so many are free, points of the classes up to this one. How many went.
  int EvictPoints(int num_free, RankClass last_class);

  const EngineConfig& config_;
  Atlas& atlas_;
  KeyframeRetrieval& retrieval_;
  std::function<void(FeatureSetHandle)> release_;
  std::function<void(MapHandle)> report_;
  EvictionCounters counters_;
  std::vector<Candidate> heap_;
  std::vector<std::uint8_t> is_protected_;  // by keyframe slot
  std::vector<Covisible> covisible_;
  std::vector<FeatureSetHandle> sets_;
  std::array<int, kNumRanks> num_of_rank_{};  // points that may go
};

}  // namespace haustra
