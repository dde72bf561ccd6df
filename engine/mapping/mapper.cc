#include "engine/mapping/mapper.h"

#include "engine/io/atlas_reader.h"
#include "engine/io/atlas_writer.h"
#include "engine/place/make_retrieval.h"
#include "hal/core/check.h"

namespace haustra {
namespace {

// What the stages of mapping hold beside the atlas: marks and positions by slot, lists that grow to what a window
// needs.
constexpr std::size_t kWorkspacePerPoint = 32;
constexpr std::size_t kWorkspacePerKeyframe = 256;
constexpr std::size_t kWorkspacePerFeature = 4096;

constexpr int kFoundingViews = 2;  // that become keyframes

}  // namespace

Mapper::Mapper(const EngineConfig& config, const CameraModel& camera, const SceneRegion& scene, VisionDevice& device,
               TrackingLink& link, PlaceMailbox& places, const Clock* clock, bool is_time_boxed,
               const Vocabulary* vocabulary, std::pmr::memory_resource* memory)
    : state_(config, camera, scene, device, link, clock, is_time_boxed, memory),
      retrieval_(MakeRetrieval(config, device, vocabulary)),
      publisher_(state_, places),
      evictor_(
          config, state_.atlas, *retrieval_, [this](FeatureSetHandle set) { publisher_.Retire(set); },
          [this](MapHandle map) { Report(MapEventKind::kMapEvicted, *current_view_, map); }),
      trial_(config.mapping),
      bundle_(config, state_.noise, camera, adjuster_),
      events_(static_cast<std::size_t>(config.memory.max_map_events), memory),
      late_poses_(static_cast<std::size_t>(config.memory.max_late_poses), memory),
      marks_(state_),
      founder_(state_),
      inserter_(state_, {publisher_, *retrieval_, evictor_, trial_, bundle_, adjuster_, marks_}),
      joiner_(state_, {places, publisher_, *retrieval_, trial_, bundle_, adjuster_, events_}),
      relocaliser_(config, config.place.relocalisation, state_.noise, config.place.retrieval, camera, scene, device,
                   *retrieval_) {}

MemoryPlan Mapper::PlanMemory(const EngineConfig& config) {
  const auto num_events = static_cast<std::size_t>(config.memory.max_map_events);
  const auto num_poses = static_cast<std::size_t>(config.memory.max_late_poses);
  const auto num_keyframes = static_cast<std::size_t>(config.memory.max_keyframes);
  MemoryPlan plan = Atlas::PlanMemory(MappingState::CapacityOf(config));
  plan.Add(MemoryPlace::kHostArena, "map events", num_events, decltype(events_)::BytesFor(num_events),
           "memory.max_map_events");
  plan.Add(MemoryPlace::kHostArena, "late poses", num_poses, decltype(late_poses_)::BytesFor(num_poses),
           "memory.max_late_poses");
  plan.Add(MemoryPlace::kHost, "retrieval", num_keyframes, RetrievalBytes(config),
           "memory.max_keyframes x retrieval.max_descriptors");
  plan.Add(MemoryPlace::kHost, "mapping workspace", 1,
           static_cast<std::uint64_t>(config.memory.max_map_points) * kWorkspacePerPoint +
               num_keyframes * kWorkspacePerKeyframe +
               static_cast<std::uint64_t>(config.features.max) * kWorkspacePerFeature,
           "memory.max_map_points, memory.max_keyframes, features.max; at most");
  // Bundles of windows and seams; Ceres for foundings and pose graphs; on the heap.
  plan.Add(MemoryPlace::kHost, "solver", 1,
           std::size_t{1'000'000} * static_cast<std::size_t>(config.rt.heap_prefault_mb), "rt.heap_prefault_mb");
  return plan;
}

bool Mapper::Step(MapWork work) {
  marks_.HearTracker();
  // Each step below tells tracking one thing at most.
  if (!publisher_.has_room()) return false;
  const bool has_answer = joiner_.TakeAnswer();
  publisher_.ReleaseRetired();
  if (has_answer) {
    is_joins_turn_ = false;
    return true;
  }
  const KeyframeProposal* proposal = state_.link.proposals.Front();
  // A join and the proposals take turns: neither keeps the other from ever being done.
  if (joiner_.is_joining() && (proposal == nullptr || is_joins_turn_)) {
    is_joins_turn_ = false;
    joiner_.GoOn();
    return true;
  }
  is_joins_turn_ = true;
  if (proposal == nullptr) return work == MapWork::kAll && (joiner_.AskForSkipped() || joiner_.SettleSeam());
  current_view_ = &proposal->view;
  state_.noise = proposal->noise;
  switch (proposal->kind) {
    case ProposalKind::kKeyframe: InsertKeyframe(*proposal, work); break;
    case ProposalKind::kFounding: FoundMap(*proposal); break;
    case ProposalKind::kPlaceless: FindFrame(proposal->view); break;
  }
  state_.link.proposals.Pop();
  state_.link.num_pending.fetch_sub(1, std::memory_order_acq_rel);
  return true;
}

Status Mapper::LoadAtlas(const SavedAtlas& saved) {
  std::vector<KeyframeHandle> keyframes;
  HAUSTRA_TRY(
      RestoreAtlas(saved, state_.camera, state_.config.features.root_sift, state_.device, &state_.atlas, &keyframes));
  // A keyframe that retrieval does not know is not found again; nothing else depends on it.
  for (const KeyframeHandle keyframe : keyframes) (void)retrieval_->Add(state_.atlas, keyframe);
  return Status::Ok();
}

Result<MarkId> Mapper::SetMark(const MarkRequest& request) {
  Result<MarkId> id = marks_.Set(request);
  if (id.ok()) publisher_.Publish();
  return id;
}

Status Mapper::RemoveMark(std::string_view label) {
  HAUSTRA_TRY(marks_.Remove(label));
  publisher_.Publish();
  return Status::Ok();
}

Status Mapper::SaveAtlas(ByteSink& sink) const {
  return WriteAtlas(state_.atlas, state_.camera.calibration(), state_.config.features.root_sift, state_.device, sink);
}

void Mapper::FoundMap(const KeyframeProposal& proposal) {
  // Relocalisation came first: the half-made map is dropped.
  const bool is_overtaken = proposal.num_found_heard != publisher_.num_found();
  // A map that is not made takes no other's place.
  if (is_overtaken || !founder_.Adjust(proposal) || !HasRoomForMap()) {
    RefuseFounding(proposal);
    return;
  }
  RetireActiveMap(proposal.view);
  state_.active = MapHandle{};
  state_.newest = KeyframeHandle{};
  HAUSTRA_CHECK(evictor_.MakeKeyframeRoom(kFoundingViews, state_.newest));
  // With too few the map is made of fewer points.
  (void)evictor_.MakePointRoom(proposal.num_pairs, state_.newest);
  HAUSTRA_CHECK(evictor_.MakeMapRoom());
  state_.active = state_.atlas.CreateMap();
  founder_.Fill(proposal, &late_poses_);
  for (const MapPointHandle point : founder_.created()) trial_.Begin(state_.active, point);
  state_.counters.num_keyframes += kFoundingViews;
  state_.counters.num_points_created += founder_.created().size();
  for (const KeyframeHandle keyframe : {founder_.reference(), state_.newest}) {
    // A keyframe that retrieval does not know is not found again; nothing else depends on it.
    (void)retrieval_->Add(state_.atlas, keyframe);
  }
  publisher_.AnnounceFounding(proposal.founding_id);
  Report(MapEventKind::kMapCreated, proposal.view, state_.active);
  publisher_.Publish();
}

// Counts what there is no room for.
bool Mapper::HasRoomForMap() {
  if (!evictor_.HasMapRoom()) {
    ++state_.counters.num_maps_refused;
    return false;
  }
  if (evictor_.HasKeyframeRoom(kFoundingViews)) return true;
  inserter_.CountRefused(kFoundingViews);
  return false;
}

void Mapper::RefuseFounding(const KeyframeProposal& proposal) {
  ++state_.counters.num_foundings_refused;
  state_.device.ReleaseFeatureSet(proposal.reference.features.set);
  state_.device.ReleaseFeatureSet(proposal.view.features.set);
  for (int i = 0; i < proposal.num_between; ++i) state_.device.ReleaseFeatureSet(proposal.between[i].features.set);
  Report(MapEventKind::kMapRefused, proposal.view, state_.active);
  publisher_.AnnounceRefusal(proposal.founding_id);
  publisher_.Publish();
}

// The map that was active is kept when it is worth it, and always when a doctor has set a mark in it.
void Mapper::RetireActiveMap(const ProposedView& view) {
  if (!state_.active) return;
  Map& map = state_.atlas.map(state_.active);
  if (static_cast<int>(map.keyframes.size()) >= state_.config.mapping.min_map_keyframes ||
      state_.atlas.HasMarks(state_.active)) {
    map.status = MapStatus::kStored;
    Report(MapEventKind::kMapStored, view, state_.active);
    return;
  }
  Report(MapEventKind::kMapDropped, view, state_.active);
  RemoveFromRetrieval(state_.active);
  std::vector<FeatureSetHandle> sets;
  state_.atlas.DropMap(state_.active, &sets);
  for (const FeatureSetHandle set : sets) publisher_.Retire(set);
}

void Mapper::RemoveFromRetrieval(MapHandle map) {
  for (const KeyframeHandle keyframe : state_.atlas.map(map).keyframes) retrieval_->Remove(keyframe);
}

void Mapper::InsertKeyframe(const KeyframeProposal& proposal, MapWork work) {
  const KeyframeHandle keyframe = inserter_.Insert(proposal);
  if (!keyframe) return;
  (void)retrieval_->Add(state_.atlas, keyframe);
  if (state_.config.merging.enabled) {
    if (work == MapWork::kAll) {
      joiner_.Ask(keyframe);
    } else {
      joiner_.PutOff(keyframe);
    }
  }
  marks_.Refine();
  publisher_.Publish();
}

// The tracker has lost its map: does any show this frame? The one that does becomes the active map.
void Mapper::FindFrame(const ProposedView& view) {
  const TimePoint start = state_.Now();
  Relocalisation found;
  relocalisations_tried_.clear();
  const bool is_found = state_.atlas.keyframes().size() > 0 &&
                        relocaliser_.Relocalise(state_.atlas, view.features, &found, &relocalisations_tried_);
  state_.device.ReleaseFeatureSet(view.features.set);
  if (is_found) {
    if (!(found.map == state_.active)) {
      RetireActiveMap(view);
      state_.active = found.map;
      state_.atlas.map(state_.active).status = MapStatus::kActive;
    }
    state_.newest = found.reference;
    const Keyframe& reference = state_.atlas.keyframe(found.reference);
    publisher_.AnnounceFound(view.frame_index, found.cam_from_map);
    LatePose pose;
    pose.frame_index = view.frame_index;
    pose.reference_keyframe = reference.id;
    pose.cam_from_reference = found.cam_from_map * reference.cam_from_map.Inverse();
    pose.reference_scale = state_.atlas.KeyframeScale(found.reference);
    pose.num_inliers = found.counts.num_inliers;
    late_poses_.TryPush(pose);
    publisher_.Publish();
  } else {
    publisher_.AnnounceNotFound();
  }
  const Duration duration = state_.Now() - start;
  state_.counters.relocalisation_time += duration;
  ++state_.counters.num_placeless;
  for (const RelocalisationCounts& counts : relocalisations_tried_) {
    if (counts.verdict == RelocalisationVerdict::kNoCandidate) continue;
    MapEvent event;
    event.kind =
        counts.verdict == RelocalisationVerdict::kAccepted ? MapEventKind::kFrameFound : MapEventKind::kFrameNotFound;
    event.frame_index = view.frame_index;
    event.timestamp = view.timestamp;
    event.map_id = counts.map_id;
    event.relocalisation = counts;
    event.duration = duration;
    events_.TryPush(event);
  }
}

void Mapper::Report(MapEventKind kind, const ProposedView& view, MapHandle map) {
  MapEvent event;
  event.kind = kind;
  event.frame_index = view.frame_index;
  event.timestamp = view.timestamp;
  if (map) {
    event.map_id = state_.atlas.map(map).id;
    event.num_keyframes = static_cast<int>(state_.atlas.map(map).keyframes.size());
    event.num_points = state_.atlas.map(map).num_points;
  }
  events_.TryPush(event);
}

}  // namespace haustra
