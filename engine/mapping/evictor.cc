#include "engine/mapping/evictor.h"

#include <algorithm>
#include <limits>

namespace haustra {
namespace {

// A keyframe of which more than this share of the points is its own is thinned out only when nothing else is left.
constexpr double kMaxOwnShare = 0.5;
// This part of a pool goes at once.
constexpr int kBatchesPerPool = 64;
// A point with this many observations or fewer helped to place keyframes rather than to find them again.
constexpr int kFewPointViews = 4;
// A keyframe with fewer points is hardly found again: relocalisation asks for some tens of inliers.
constexpr int kThinKeyframePoints = 64;
constexpr int kPointsPerRichnessStep = 16;
constexpr int kAnySize = std::numeric_limits<int>::max();

}  // namespace

Evictor::Evictor(const EngineConfig& config, Atlas& atlas, KeyframeRetrieval& retrieval,
                 std::function<void(FeatureSetHandle)> release, std::function<void(MapHandle)> report)
    : config_(config),
      atlas_(atlas),
      retrieval_(retrieval),
      release_(std::move(release)),
      report_(std::move(report)),
      is_protected_(static_cast<std::size_t>(config.memory.max_keyframes), 0) {
  heap_.reserve(is_protected_.size());
  covisible_.reserve(is_protected_.size());
  sets_.reserve(is_protected_.size());
}

int Evictor::NumFreeKeyframes() const {
  return static_cast<int>(atlas_.keyframes().capacity() - atlas_.keyframes().size());
}

int Evictor::NumFreePoints() const { return static_cast<int>(atlas_.points().capacity() - atlas_.points().size()); }

bool Evictor::MakeKeyframeRoom(int wanted, KeyframeHandle newest) {
  if (NumFreeKeyframes() >= wanted) return true;
  const int batch = std::max(wanted, config_.memory.max_keyframes / kBatchesPerPool);
  Protect(newest);
  EvictKeyframes(batch, Which::kInactive, kMaxOwnShare);
  if (NumFreeKeyframes() < wanted) EvictKeyframes(batch, Which::kActive, kMaxOwnShare);
  // A map that is dropped takes its frames with it: no more of that than is needed.
  while (NumFreeKeyframes() < wanted && EvictSmallestMap(config_.memory.small_map_keyframes)) continue;
  if (NumFreeKeyframes() < wanted) EvictKeyframes(batch, Which::kAll, 1.0);
  return NumFreeKeyframes() >= wanted;
}

bool Evictor::MakePointRoom(int wanted, KeyframeHandle newest) {
  wanted = std::min(wanted, config_.memory.max_map_points / 4);
  if (NumFreePoints() >= wanted) return true;
  const int batch = wanted + config_.memory.max_map_points / kBatchesPerPool;
  Protect(newest);
  CountRanks();
  int num_evicted = EvictPoints(batch, kFewOfInactive);
  while (NumFreePoints() < wanted && EvictSmallestMap(config_.memory.small_map_keyframes)) ++num_evicted;
  while (NumFreePoints() < wanted) {
    if (num_evicted > 0) CountRanks();
    num_evicted = EvictPoints(batch, kAnyOfActive);
    if (num_evicted == 0) break;
  }
  return NumFreePoints() >= wanted;
}

bool Evictor::MakeMapRoom() {
  if (atlas_.maps().size() < atlas_.maps().capacity()) return true;
  for (int attempt = 0; attempt < 2; ++attempt) {
    for (const MapStatus status : {MapStatus::kDropped, MapStatus::kMerged}) {
      MapHandle oldest;
      atlas_.maps().ForEach([&](MapHandle handle, const Map& map) {
        if (map.status == status && (!oldest || map.id < atlas_.map(oldest).id)) oldest = handle;
      });
      if (!oldest) continue;
      atlas_.ForgetMap(oldest);
      ++counters_.num_map_entries;
      return true;
    }
    if (!EvictSmallestMap(kAnySize)) return false;
  }
  return false;
}

// Every entry can be used again but those of maps with marks.
bool Evictor::HasMapRoom() const {
  bool has_room = atlas_.maps().size() < atlas_.maps().capacity();
  atlas_.maps().ForEach([&](MapHandle handle, const Map&) { has_room = has_room || !atlas_.HasMarks(handle); });
  return has_room;
}

bool Evictor::HasKeyframeRoom(int wanted) const {
  if (static_cast<int>(atlas_.num_keyframe_ids()) + wanted > atlas_.capacity().max_keyframe_ids) return false;
  const int min_map = config_.mapping.min_map_keyframes;
  int num_free = NumFreeKeyframes();
  atlas_.maps().ForEach([&](MapHandle handle, const Map& map) {
    const auto num = static_cast<int>(map.keyframes.size());
    if (num_free >= wanted) return;
    const bool is_small = num <= config_.memory.small_map_keyframes || (!IsInactive(map) && num < min_map);
    num_free += is_small && !atlas_.HasMarks(handle) ? num : std::max(0, num - min_map);
  });
  return num_free >= wanted;
}

void Evictor::Protect(KeyframeHandle newest) {
  std::fill(is_protected_.begin(), is_protected_.end(), std::uint8_t{0});
  if (atlas_.GetKeyframe(newest) == nullptr) return;
  is_protected_[newest.index] = 1;
  atlas_.FindCovisible(newest, 1, &covisible_);
  for (const Covisible& neighbour : covisible_) is_protected_[neighbour.keyframe.index] = 1;
}

int Evictor::NumOwnPoints(const Keyframe& keyframe) const {
  int num = 0;
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (keyframe.points[i] && atlas_.point(keyframe.points[i]).observations.size() <= kFewViews) ++num;
  }
  return num;
}

// Greedy with late evaluation: what has gone may have made the others more useful, never less.
void Evictor::EvictKeyframes(int wanted, Which which, double max_own_share) {
  heap_.clear();
  atlas_.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& keyframe) {
    if (is_protected_[handle.index] != 0) return;
    const Map& map = atlas_.map(keyframe.map);
    if (which != Which::kAll && IsInactive(map) != (which == Which::kInactive)) return;
    // The first keyframe of the active map holds its frame of reference.
    if (!IsInactive(map) && map.keyframes.front() == handle) return;
    heap_.push_back({NumOwnPoints(keyframe), keyframe.id, handle});
  });
  std::make_heap(heap_.begin(), heap_.end(), std::greater<>());
  while (NumFreeKeyframes() < wanted && !heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
    Candidate candidate = heap_.back();
    heap_.pop_back();
    const Keyframe& keyframe = atlas_.keyframe(candidate.keyframe);
    if (static_cast<int>(atlas_.map(keyframe.map).keyframes.size()) <= config_.mapping.min_map_keyframes) continue;
    candidate.num_own = NumOwnPoints(keyframe);
    if (candidate.num_own > max_own_share * keyframe.num_points) continue;
    if (!heap_.empty() && candidate > heap_.front()) {
      heap_.push_back(candidate);
      std::push_heap(heap_.begin(), heap_.end(), std::greater<>());
      continue;
    }
    EvictKeyframe(candidate.keyframe);
    ++counters_.num_keyframes;
  }
}

void Evictor::EvictKeyframe(KeyframeHandle handle) {
  atlas_.FindCovisible(handle, 1, &covisible_);
  KeyframeHandle stand_in;
  if (!covisible_.empty()) {
    stand_in = covisible_.front().keyframe;
  } else {
    const auto& all = atlas_.map(atlas_.keyframe(handle).map).keyframes;
    const auto self = std::find(all.begin(), all.end(), handle);
    stand_in = self == all.begin() ? *(self + 1) : *(self - 1);
  }
  retrieval_.Remove(handle);
  release_(atlas_.RemoveKeyframe(handle, stand_in));
}

bool Evictor::EvictSmallestMap(int max_keyframes) {
  MapHandle smallest;
  std::size_t num_keyframes = 0;
  atlas_.maps().ForEach([&](MapHandle handle, const Map& map) {
    if (!IsInactive(map) || map.keyframes.size() > static_cast<std::size_t>(max_keyframes)) return;
    if (atlas_.HasMarks(handle)) return;
    const bool is_smaller = !smallest || map.keyframes.size() < num_keyframes ||
                            (map.keyframes.size() == num_keyframes && map.id < atlas_.map(smallest).id);
    if (!is_smaller) return;
    smallest = handle;
    num_keyframes = map.keyframes.size();
  });
  if (!smallest) return false;
  report_(smallest);
  for (const KeyframeHandle keyframe : atlas_.map(smallest).keyframes) retrieval_.Remove(keyframe);
  sets_.clear();
  atlas_.DropMap(smallest, &sets_);
  for (const FeatureSetHandle set : sets_) release_(set);
  ++counters_.num_maps;
  return true;
}

int Evictor::RankOf(const MapPoint& point) const {
  int thinnest = kAnySize;
  for (const Observation& observation : point.observations) {
    if (is_protected_[observation.keyframe.index] != 0) return -1;
    thinnest = std::min(thinnest, atlas_.keyframe(observation.keyframe).num_points);
  }
  const auto num_views = static_cast<int>(point.observations.size());
  const bool is_thin = thinnest < kThinKeyframePoints, is_inactive = IsInactive(atlas_.map(point.map));
  const bool is_spent = !is_thin && num_views <= (is_inactive ? kFewPointViews : 2);
  const RankClass rank_class =
      is_inactive ? (is_spent ? kFewOfInactive : kAnyOfInactive) : (is_spent ? kTwoOfActive : kAnyOfActive);
  const int richness = std::min(thinnest / kPointsPerRichnessStep, kRichnessSteps - 1);
  const int of_views = (is_thin ? kMaxObservations + 1 : 0) + num_views;
  return rank_class * kRanksOfClass + of_views * kRichnessSteps + kRichnessSteps - 1 - richness;
}

// The ranks are counted, so that nothing has to be sorted.
void Evictor::CountRanks() {
  num_of_rank_.fill(0);
  atlas_.points().ForEach([&](MapPointHandle, const MapPoint& point) {
    if (const int rank = RankOf(point); rank >= 0) ++num_of_rank_[static_cast<std::size_t>(rank)];
  });
}

// As points go, keyframes become thinner and the ranks of the others rise: those that are not the least useful any more
// stay for now.
int Evictor::EvictPoints(int num_free, RankClass last_class) {
  const int end = (last_class + 1) * kRanksOfClass;
  int last_rank = -1, num_found = 0;
  while (num_found < num_free - NumFreePoints() && last_rank + 1 < end) {
    num_found += num_of_rank_[static_cast<std::size_t>(++last_rank)];
  }
  if (num_found == 0) return 0;
  const std::uint64_t num_before = counters_.num_points;
  atlas_.points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
    if (NumFreePoints() >= num_free) return;
    const int rank = RankOf(point);
    if (rank < 0 || rank > last_rank) return;
    atlas_.RemovePoint(handle);
    ++counters_.num_points;
  });
  return static_cast<int>(counters_.num_points - num_before);
}

}  // namespace haustra
