// Publishes what tracking may know: a LocalMap around the newest keyframe, and with it the mapper's answers. An answer
// stands in every snapshot from then on, so the tracker may miss any number of them. Keeps the feature sets that a
// snapshot may still name until the tracker has a newer one. thread-bound(mapping), but for pool_use.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "engine/atlas/local_map.h"
#include "engine/mapping/mapping_state.h"
#include "engine/place/place_mailbox.h"

namespace haustra {

// How many entries of each pool are in use.
struct PoolUse {
  std::uint32_t keyframes = 0;
  std::uint32_t map_points = 0;
  std::uint32_t maps = 0;
  std::uint32_t keyframe_ids = 0;
  std::uint32_t free_feature_sets = 0;
};

class SnapshotPublisher {
 public:
  // Both outlive it.
  SnapshotPublisher(MappingState& state, const PlaceMailbox& places);

  // A snapshot of the state and of all that was announced.
  void Publish();

  // To be published. The proposal founded the active map, or founds none; the last of each kind stands.
  void AnnounceFounding(std::uint64_t proposal) { founding_proposal_ = proposal; }
  void AnnounceRefusal(std::uint64_t proposal) { refused_proposal_ = proposal; }
  // The frame was found in the active map. Its pose goes along with the map until the next one is found.
  void AnnounceFound(std::uint32_t frame_index, const SE3& cam_from_map);
  // A map was moved; the sequence is given here. The last kMaxReframings stand.
  void Reframe(const Reframing& reframing);

  // Takes a pose in map `map_id`, which has been through the reframings up to `done`, to where it is now.
  void FollowReframings(std::uint64_t done, MapId* map_id, SE3* cam_from_map) const;
  // Of the last frame announced as found.
  std::uint64_t found_sequence() const { return found_frame_.sequence; }

  // Takes a feature set that the atlas has given up; it is released when neither a snapshot in use nor a question of
  // place recognition can name it.
  void Retire(FeatureSetHandle set) { retired_.push_back({version_ + 1, places_.num_asked(), set}); }
  void ReleaseRetired();

  // As of the last snapshot. thread-safe; each figure for itself.
  PoolUse pool_use() const;

 private:
  struct RetiredSet {
    std::uint64_t version;    // first snapshot that does not refer to it
    std::uint64_t num_asked;  // questions before it went: any of them may name it
    FeatureSetHandle set;
  };

  MappingState& state_;
  const PlaceMailbox& places_;
  LocalMapBuilder builder_;
  std::uint64_t version_ = 0;
  std::uint64_t founding_proposal_ = 0;
  std::uint64_t refused_proposal_ = 0;
  FoundFrame found_frame_;
  MapId found_map_id_ = kNoId;
  FixedVector<Reframing, kMaxReframings> reframings_;  // the latest ones, oldest first
  std::vector<RetiredSet> retired_;
  std::atomic<std::uint32_t> keyframes_in_use_{0};
  std::atomic<std::uint32_t> points_in_use_{0};
  std::atomic<std::uint32_t> maps_in_use_{0};
  std::atomic<std::uint32_t> ids_in_use_{0};
};

}  // namespace haustra
