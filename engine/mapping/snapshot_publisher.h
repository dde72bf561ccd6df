// Publishes what tracking may know: a LocalMap around the newest keyframe, as a snapshot that may be missed, and what
// has happened, as replies that may not. Keeps the feature sets that a snapshot may still name until the tracker has a
// newer one. thread-bound(mapping), but for pool_use.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "engine/atlas/local_map.h"
#include "engine/mapping/mapping_state.h"
#include "engine/place/place_mailbox.h"
#include "engine/tracking/map_reply.h"

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

  // A snapshot of the state. The replies since the last one are heard together with it.
  void Publish();

  // Room for one more reply: a step that may tell something begins only then, and tells one thing.
  bool has_room() const { return state_.link.replies.size() < state_.link.replies.capacity(); }
  // To be followed by Publish() in the same step. The proposal founded the active map, whose newest keyframe is its
  // second view; or it founds none.
  void AnnounceFounding(std::uint64_t proposal);
  void AnnounceRefusal(std::uint64_t proposal) { Tell(version_ + 1, MapRefused{proposal}); }
  // The frame was found in the active map.
  void AnnounceFound(std::uint32_t frame_index, const SE3& cam_from_map);
  // A map was moved.
  void Reframe(const Reframing& reframing);
  // Without a new snapshot: no map shows the frame.
  void AnnounceNotFound() { Tell(version_, FrameNotFound{}); }

  // Takes a pose in map `map_id`, which has been through the first `num_heard` reframings, to where it is now. False,
  // with nothing touched: too much has happened since (kMaxReframings), or its map was built anew, and the pose is of
  // the former shape.
  [[nodiscard]] bool FollowReframings(std::uint64_t num_heard, MapId* map_id, SE3* cam_from_map) const;
  // Announced so far.
  std::uint64_t num_found() const { return num_found_; }

  // Takes a feature set that the atlas has given up; it is released when neither a snapshot in use nor a question of
  // place recognition can name it. Not before the next Publish().
  void Retire(FeatureSetHandle set) { retired_.push_back({version_ + 1, places_.num_asked(), set}); }
  void ReleaseRetired();

  // As of the last snapshot. thread-safe; each figure for itself.
  PoolUse pool_use() const;

 private:
  void ListMarks(LocalMap* snapshot) const;
  void Tell(std::uint64_t version, const MapReply& reply);

  // A keyframe waits while maps are joined and settle once; more than twice so much is never seen.
  static constexpr std::size_t kMaxReframings = 16;

  struct RetiredSet {
    std::uint64_t version;    // first snapshot that does not refer to it
    std::uint64_t num_asked;  // questions before it went: any of them may name it
    FeatureSetHandle set;
  };

  MappingState& state_;
  const PlaceMailbox& places_;
  LocalMapBuilder builder_;
  std::uint64_t version_ = 0;
  std::uint64_t num_found_ = 0;
  std::uint64_t num_reframings_ = 0;
  std::array<Reframing, kMaxReframings> reframings_;  // the latest ones, by their number modulo the size
  std::vector<RetiredSet> retired_;
  std::atomic<std::uint32_t> keyframes_in_use_{0};
  std::atomic<std::uint32_t> points_in_use_{0};
  std::atomic<std::uint32_t> maps_in_use_{0};
  std::atomic<std::uint32_t> ids_in_use_{0};
};

}  // namespace haustra
