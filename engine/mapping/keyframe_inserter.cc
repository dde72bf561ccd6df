#include "engine/mapping/keyframe_inserter.h"

#include <algorithm>

namespace haustra {
namespace {

// Of a bundle that a waiting proposal ends: a tracker in need must not keep the map from ever being adjusted.
constexpr int kMinBundleIterations = 3;

}  // namespace

KeyframeInserter::KeyframeInserter(MappingState& state, Parts parts)
    : state_(state),
      publisher_(parts.publisher),
      retrieval_(parts.retrieval),
      evictor_(parts.evictor),
      trial_(parts.trial),
      bundle_(parts.bundle),
      marks_(parts.marks),
      creator_(state.config, state.noise, state.camera, state.device),
      fuser_(state.config, state.noise, state.camera, state.device),
      linker_(state.config, state.noise, state.camera, state.device),
      relief_(state.config, state.noise, state.camera, state.device, parts.adjuster),
      is_candidate_(static_cast<std::size_t>(state.config.memory.max_map_points), 0) {}

KeyframeHandle KeyframeInserter::Insert(const KeyframeProposal& proposal) {
  // The map may have been joined or moved while the proposal waited.
  SE3 cam_from_map = proposal.cam_from_map;
  MapId map_id = proposal.map_id;
  const bool is_known = publisher_.FollowReframings(proposal.num_reframings_heard, &map_id, &cam_from_map);
  if (!is_known || !state_.active || state_.atlas.map(state_.active).id != map_id) {
    state_.device.ReleaseFeatureSet(proposal.view.features.set);
    return {};
  }
  const TimePoint start = state_.Now();
  const KeyframeHandle handle = AddKeyframe(proposal, cam_from_map);
  if (!handle) return {};
  LinkToNeighbours(handle);
  // A point seen in a few neighbouring keyframes only helped to place those; when they have settled it has done its
  // work. What the map keeps are the points that can be found again.
  state_.counters.num_points_culled += static_cast<std::uint64_t>(trial_.CountKeyframe(state_.active, &state_.atlas));
  const TimePoint inserted = state_.Now();
  CreatePoints(handle);
  const TimePoint made = state_.Now();
  SearchInNeighbours(handle);
  const TimePoint fused = state_.Now();
  if (state_.is_time_boxed) publisher_.Publish();
  AdjustAround(handle, {state_.config.mapping.window_keyframes, true, state_.config.mapping.bundle_iterations}, true);
  const TimePoint adjusted = state_.Now();
  CullKeyframes(handle);
  const TimePoint culled = state_.Now();
  state_.counters.insert_time += inserted - start;
  state_.counters.create_time += made - inserted;
  state_.counters.fuse_time += fused - made;
  state_.counters.bundle_time += adjusted - fused;
  state_.counters.cull_time += culled - adjusted;
  return handle;
}

// With the points that tracking saw in it. Invalid: there is no room, even when the evictor has made some.
KeyframeHandle KeyframeInserter::AddKeyframe(const KeyframeProposal& proposal, const SE3& cam_from_map) {
  (void)evictor_.MakeKeyframeRoom(1, state_.newest);
  (void)evictor_.MakePointRoom(state_.config.features.max, state_.newest);
  const KeyframeHandle handle = state_.atlas.AddKeyframe(state_.active, proposal.view.frame_index,
                                                         proposal.view.timestamp, cam_from_map, proposal.view.features);
  if (!handle) {
    state_.device.ReleaseFeatureSet(proposal.view.features.set);
    CountRefused();
    return {};
  }
  state_.newest = handle;
  ++state_.counters.num_keyframes;
  for (int i = 0; i < proposal.view.features.num; ++i) {
    const MapPointHandle point = proposal.points[i];
    // Points that were culled or fused while the proposal waited are found again by LinkToNeighbours.
    if (!point || state_.atlas.GetPoint(point) == nullptr) continue;
    if (state_.atlas.AddObservation(point, handle, i)) state_.atlas.UpdatePoint(point);
  }
  return handle;
}

// By appearance, which places it better and shows whether a young map has its relief turned; then the neighbours'
// points are searched where the poses put them. created_: the points that the links made.
void KeyframeInserter::LinkToNeighbours(KeyframeHandle handle) {
  state_.atlas.FindCovisible(handle, state_.config.mapping.min_shared_points, &covisible_);
  created_.clear();
  linker_.Link(handle, covisible_, &state_.atlas, &created_);
  CheckRelief(handle);
  // What is searched below is searched where the poses put it: first the tracks have their say.
  const LocalBundle::Extent linked{state_.config.mapping.link_window_keyframes, true,
                                   state_.config.mapping.bundle_iterations};
  if (state_.config.mapping.link_neighbours > 0) AdjustAround(handle, linked, false);
  state_.atlas.FindCovisible(handle, state_.config.mapping.min_shared_points, &covisible_);
  CollectPoints(covisible_, state_.config.mapping.fuse_neighbours, &candidates_);
  state_.counters.num_points_fused += fuser_.SearchInto(handle, candidates_, &state_.atlas);
}

// All that are new, those of the links too, begin their trial.
void KeyframeInserter::CreatePoints(KeyframeHandle handle) {
  state_.atlas.FindCovisible(handle, state_.config.mapping.min_shared_points, &covisible_);
  creator_.Create(handle, covisible_, &state_.atlas, &created_);
  state_.counters.num_points_created += created_.size();
  for (const MapPointHandle point : created_) trial_.Begin(state_.active, point);
}

// What the new keyframe brings is searched in its neighbours.
void KeyframeInserter::SearchInNeighbours(KeyframeHandle handle) {
  candidates_.clear();
  const Keyframe& keyframe = state_.atlas.keyframe(handle);
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (keyframe.points[i]) candidates_.push_back(keyframe.points[i]);
  }
  for (std::size_t i = 0; i < covisible_.size() && i < static_cast<std::size_t>(state_.config.mapping.fuse_neighbours);
       ++i) {
    state_.counters.num_points_fused += fuser_.SearchInto(covisible_[i].keyframe, candidates_, &state_.atlas);
  }
}

// Poses of before do not compare with those of after: tracking hears of it as of a map that was moved.
void KeyframeInserter::CheckRelief(KeyframeHandle handle) {
  const Map& map = state_.atlas.map(state_.active);
  if (state_.is_seam_open || static_cast<int>(map.keyframes.size()) > state_.config.mapping.relief_keyframes) return;
  if (!relief_.Correct(handle, covisible_, &state_.atlas)) return;
  ++state_.counters.num_reliefs_turned;
  publisher_.Reframe({map.id, map.id, Sim3(), false});
  for (const KeyframeHandle keyframe : map.keyframes) {
    state_.atlas.keyframe(keyframe).turned_at = state_.counters.num_reframings;
  }
  // Before keyframes that hold them are culled.
  marks_.MapWasTurned();
}

// A failed adjustment leaves the map as it was, one that was stopped keeps what it gained; the next keyframe tries
// again.
void KeyframeInserter::AdjustAround(KeyframeHandle handle, const LocalBundle::Extent& extent, bool may_be_interrupted) {
  if (state_.is_seam_open) return;
  const int min_iterations = may_be_interrupted ? kMinBundleIterations : extent.max_iterations;
  const Result<BundleSummary> bundle = bundle_.Adjust(
      handle, extent, state_.BundleLimits(state_.config.mapping.max_bundle_ms, 1, min_iterations), &state_.atlas);
  if (bundle.ok() && bundle->state == SolveState::kPartial) ++state_.counters.num_bundles_stopped;
}

void KeyframeInserter::CollectPoints(std::span<const Covisible> keyframes, int max_keyframes,
                                     std::vector<MapPointHandle>* out) {
  out->clear();
  for (std::size_t k = 0; k < keyframes.size() && k < static_cast<std::size_t>(max_keyframes); ++k) {
    const Keyframe& keyframe = state_.atlas.keyframe(keyframes[k].keyframe);
    for (int i = 0; i < keyframe.features.num; ++i) {
      const MapPointHandle point = keyframe.points[i];
      if (!point || is_candidate_[point.index] != 0) continue;
      is_candidate_[point.index] = 1;
      out->push_back(point);
    }
  }
  for (const MapPointHandle point : *out) is_candidate_[point.index] = 0;
}

void KeyframeInserter::CullKeyframes(KeyframeHandle newest) {
  state_.atlas.FindCovisible(newest, state_.config.mapping.min_shared_points, &covisible_);
  const auto& all = state_.atlas.map(state_.active).keyframes;
  for (const Covisible& covisible : covisible_) {
    // With fewer the map would be dropped at the next loss.
    if (static_cast<int>(all.size()) <= state_.config.mapping.min_map_keyframes) return;
    // The first keyframe holds the frame of reference, the last but one is what the tracker came from.
    if (covisible.keyframe == all.front() || covisible.keyframe == all[all.size() - 2]) continue;
    if (!IsRedundant(covisible.keyframe)) continue;
    // The neighbour that shares most points takes over the frames that were tracked against it.
    std::vector<Covisible> neighbours;
    state_.atlas.FindCovisible(covisible.keyframe, 1, &neighbours);
    if (neighbours.empty()) continue;
    retrieval_.Remove(covisible.keyframe);
    publisher_.Retire(state_.atlas.RemoveKeyframe(covisible.keyframe, neighbours.front().keyframe));
    ++state_.counters.num_keyframes_culled;
  }
}

// Most of its points are seen in at least three other keyframes at the same or a finer scale.
bool KeyframeInserter::IsRedundant(KeyframeHandle handle) const {
  const Keyframe& keyframe = state_.atlas.keyframe(handle);
  if (keyframe.num_points == 0) return true;
  int num_seen_elsewhere = 0;
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i]) continue;
    const MapPoint& point = state_.atlas.point(keyframe.points[i]);
    const float coarsest = keyframe.features.keypoints[i].scale_px * 1.2f;
    int others = 0;
    for (const Observation& observation : point.observations) {
      if (observation.keyframe == handle) continue;
      const FrameFeatures& features = state_.atlas.keyframe(observation.keyframe).features;
      if (features.keypoints[observation.feature_idx].scale_px <= coarsest && ++others == 3) break;
    }
    if (others >= 3) ++num_seen_elsewhere;
  }
  return num_seen_elsewhere > state_.config.mapping.redundant_share * keyframe.num_points;
}

void KeyframeInserter::CountRefused(KeyframeId wanted) {
  ++state_.counters.num_keyframes_refused;
  if (state_.atlas.num_keyframe_ids() + wanted > static_cast<KeyframeId>(state_.atlas.capacity().max_keyframe_ids)) {
    ++state_.counters.num_keyframe_ids_refused;
  }
}

}  // namespace haustra
