#include "engine/mapping/snapshot_publisher.h"

#include "hal/core/check.h"

namespace haustra {

SnapshotPublisher::SnapshotPublisher(MappingState& state, const PlaceMailbox& places)
    : state_(state), places_(places), builder_(state.config.memory.max_keyframes, state.config.memory.max_map_points) {}

void SnapshotPublisher::Publish() {
  LocalMap& snapshot = state_.link.snapshots.WriteSlot();
  snapshot.version = ++version_;
  if (state_.active && state_.newest) {
    snapshot.map_id = state_.atlas.map(state_.active).id;
    builder_.Build(state_.atlas, state_.newest, &snapshot);
    state_.counters.num_snapshots_cut = builder_.num_cut();
    ListMarks(&snapshot);
  } else {
    snapshot.map_id = kNoId;
    snapshot.keyframes.Clear();
    snapshot.num_points = 0;
    snapshot.marks.Clear();
  }
  state_.link.snapshots.Publish();
  keyframes_in_use_.store(state_.atlas.keyframes().size(), std::memory_order_relaxed);
  points_in_use_.store(state_.atlas.points().size(), std::memory_order_relaxed);
  maps_in_use_.store(state_.atlas.maps().size(), std::memory_order_relaxed);
  ids_in_use_.store(state_.atlas.num_keyframe_ids(), std::memory_order_relaxed);
}

void SnapshotPublisher::ListMarks(LocalMap* snapshot) const {
  snapshot->marks.Clear();
  state_.atlas.marks().ForEach([&](MarkHandle, const Mark& mark) {
    const PlacedMark place = state_.atlas.PlaceOf(mark);
    if (place.map != state_.active) return;
    // The pool holds no more than there is room for.
    HAUSTRA_CHECK(snapshot->marks.PushBack({mark.id, place.position, place.normal, place.radius}));
  });
}

void SnapshotPublisher::Tell(std::uint64_t version, const MapReply& reply) {
  HAUSTRA_CHECK(state_.link.replies.TryPush({version, reply}));
}

void SnapshotPublisher::AnnounceFounding(std::uint64_t proposal) {
  Tell(version_ + 1,
       MapFounded{proposal, state_.atlas.map(state_.active).id, state_.atlas.keyframe(state_.newest).cam_from_map});
}

void SnapshotPublisher::AnnounceFound(std::uint32_t frame_index, const SE3& cam_from_map) {
  ++num_found_;
  Tell(version_ + 1, FrameFound{frame_index, state_.atlas.map(state_.active).id, cam_from_map});
}

void SnapshotPublisher::Reframe(const Reframing& reframing) {
  reframings_[num_reframings_++ % kMaxReframings] = reframing;
  state_.counters.num_reframings = num_reframings_;
  Tell(version_ + 1, reframing);
}

bool SnapshotPublisher::FollowReframings(std::uint64_t num_heard, MapId* map_id, SE3* cam_from_map) const {
  if (num_reframings_ - num_heard > kMaxReframings) return false;
  MapId now_in = *map_id;
  SE3 pose = *cam_from_map;
  for (std::uint64_t i = num_heard; i < num_reframings_; ++i) {
    const Reframing& reframing = reframings_[i % kMaxReframings];
    if (reframing.Carry(&now_in, &pose) && !reframing.keeps_shape) return false;
  }
  *map_id = now_in;
  *cam_from_map = pose;
  return true;
}

void SnapshotPublisher::ReleaseRetired() {
  const std::uint64_t done = state_.link.version_done.load(std::memory_order_acquire);
  std::size_t kept = 0;
  for (const RetiredSet& retired : retired_) {
    if (retired.version <= done && retired.num_asked <= places_.num_taken()) {
      state_.device.ReleaseFeatureSet(retired.set);
    } else {
      retired_[kept++] = retired;
    }
  }
  retired_.resize(kept);
}

PoolUse SnapshotPublisher::pool_use() const {
  return {keyframes_in_use_.load(std::memory_order_relaxed), points_in_use_.load(std::memory_order_relaxed),
          maps_in_use_.load(std::memory_order_relaxed), ids_in_use_.load(std::memory_order_relaxed),
          static_cast<std::uint32_t>(state_.device.num_free_feature_sets())};
}

}  // namespace haustra
