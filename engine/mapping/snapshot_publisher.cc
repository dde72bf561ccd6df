#include "engine/mapping/snapshot_publisher.h"

#include <algorithm>

namespace haustra {

SnapshotPublisher::SnapshotPublisher(MappingState& state, const PlaceMailbox& places)
    : state_(state), places_(places), builder_(state.config.memory.max_keyframes, state.config.memory.max_map_points) {}

void SnapshotPublisher::Publish() {
  LocalMap& snapshot = state_.link.snapshots.WriteSlot();
  snapshot.version = ++version_;
  snapshot.founding_proposal = founding_proposal_;
  snapshot.refused_proposal = refused_proposal_;
  snapshot.found_frame = found_frame_;
  snapshot.reframings = reframings_;
  if (state_.active && state_.newest) {
    snapshot.map_id = state_.atlas.map(state_.active).id;
    builder_.Build(state_.atlas, state_.newest, &snapshot);
    state_.counters.num_snapshots_cut = builder_.num_cut();
  } else {
    snapshot.map_id = kNoId;
    snapshot.keyframes.Clear();
    snapshot.num_points = 0;
  }
  state_.link.snapshots.Publish();
  keyframes_in_use_.store(state_.atlas.keyframes().size(), std::memory_order_relaxed);
  points_in_use_.store(state_.atlas.points().size(), std::memory_order_relaxed);
  maps_in_use_.store(state_.atlas.maps().size(), std::memory_order_relaxed);
  ids_in_use_.store(state_.atlas.num_keyframe_ids(), std::memory_order_relaxed);
}

void SnapshotPublisher::AnnounceFound(std::uint32_t frame_index, const SE3& cam_from_map) {
  found_frame_ = {found_frame_.sequence + 1, frame_index, cam_from_map};
  found_map_id_ = state_.atlas.map(state_.active).id;
}

void SnapshotPublisher::Reframe(const Reframing& reframing) {
  if (reframings_.full()) {
    std::move(reframings_.begin() + 1, reframings_.end(), reframings_.begin());
    reframings_.SwapErase(reframings_.size() - 1);
  }
  HAUSTRA_CHECK(reframings_.PushBack(reframing));
  reframings_[reframings_.size() - 1].sequence = ++state_.counters.num_reframings;
  if (found_map_id_ == reframing.old_map_id) {
    found_frame_.cam_from_map = TransformPose(found_frame_.cam_from_map, reframing.new_from_old);
    found_map_id_ = reframing.new_map_id;
  }
}

void SnapshotPublisher::FollowReframings(std::uint64_t done, MapId* map_id, SE3* cam_from_map) const {
  for (const Reframing& reframing : reframings_) {
    if (reframing.sequence <= done || reframing.old_map_id != *map_id) continue;
    *cam_from_map = TransformPose(*cam_from_map, reframing.new_from_old);
    *map_id = reframing.new_map_id;
  }
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
