#include "engine/mapping/mapper.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "engine/io/atlas_reader.h"
#include "engine/io/atlas_writer.h"
#include "engine/place/make_retrieval.h"

namespace haustra {
namespace {

constexpr int kFoundingIterations = 20;
// A slice of bundle adjustment that leaves this much of the cost has little left to do.
constexpr double kSettledShare = 0.995;
// Of a bundle that a waiting proposal ends: a tracker in need must not keep the map from ever being adjusted.
constexpr int kMinBundleIterations = 3;

// What the stages of mapping hold beside the atlas: marks and positions by slot, lists that grow to what a window
// needs.
constexpr std::size_t kWorkspacePerPoint = 28;
constexpr std::size_t kWorkspacePerKeyframe = 256;
constexpr std::size_t kWorkspacePerFeature = 4096;

Atlas::Capacity CapacityOf(const EngineConfig& config) {
  return {config.memory.max_keyframes, config.memory.max_map_points, config.memory.max_maps,
          config.memory.max_keyframe_ids, config.features.max};
}

}  // namespace

Mapper::Mapper(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, TrackingLink& link,
               PlaceMailbox& places, const Clock* clock, bool is_time_boxed, const Vocabulary* vocabulary,
               std::pmr::memory_resource* memory)
    : config_(config),
      camera_(camera),
      device_(device),
      link_(link),
      places_(places),
      clock_(clock),
      is_time_boxed_(is_time_boxed && clock != nullptr),
      noise_(config.noise),
      atlas_(CapacityOf(config), memory),
      builder_(config.memory.max_keyframes, config.memory.max_map_points),
      creator_(config, noise_, camera, device),
      fuser_(config, noise_, camera, device),
      trial_(config.mapping),
      linker_(config, noise_, camera, device),
      bundle_(config, noise_, camera, adjuster_),
      late_placement_(config, noise_, camera, device),
      retrieval_(MakeRetrieval(config, device, vocabulary)),
      relocaliser_(config, config.place.relocalisation, noise_, config.place.retrieval, camera, device, *retrieval_),
      scout_(config, *retrieval_),
      merger_(config, config.merging, noise_, camera, device, adjuster_),
      evictor_(
          config, atlas_, *retrieval_, [this](FeatureSetHandle set) { Retire(set); },
          [this](MapHandle map) { ReportEviction(map); }),
      events_(static_cast<std::size_t>(config.memory.max_map_events), memory),
      late_poses_(static_cast<std::size_t>(config.memory.max_late_poses), memory),
      is_candidate_(static_cast<std::size_t>(config.memory.max_map_points), 0) {}

MemoryPlan Mapper::PlanMemory(const EngineConfig& config) {
  const auto num_events = static_cast<std::size_t>(config.memory.max_map_events);
  const auto num_poses = static_cast<std::size_t>(config.memory.max_late_poses);
  const auto num_keyframes = static_cast<std::size_t>(config.memory.max_keyframes);
  MemoryPlan plan = Atlas::PlanMemory(CapacityOf(config));
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

bool Mapper::Step() {
  const bool has_answer = TakeAnswer();
  ReleaseRetired();
  if (has_answer) return true;
  const KeyframeProposal* proposal = link_.proposals.Front();
  if (proposal == nullptr) return AskForSkipped() || Settle();
  current_view_ = &proposal->view;
  noise_ = proposal->noise;
  switch (proposal->kind) {
    case ProposalKind::kKeyframe: InsertKeyframe(*proposal); break;
    case ProposalKind::kFounding: FoundMap(*proposal); break;
    case ProposalKind::kPlaceless: FindPlace(proposal->view); break;
  }
  link_.proposals.Pop();
  link_.num_pending.fetch_sub(1, std::memory_order_acq_rel);
  return true;
}

Status Mapper::LoadAtlas(const SavedAtlas& saved) {
  std::vector<KeyframeHandle> keyframes;
  HAUSTRA_TRY(RestoreAtlas(saved, camera_, config_.features.root_sift, device_, &atlas_, &keyframes));
  // A keyframe that retrieval does not know is not found again; nothing else depends on it.
  for (const KeyframeHandle keyframe : keyframes) (void)retrieval_->Add(atlas_, keyframe);
  return Status::Ok();
}

Status Mapper::SaveAtlas(ByteSink& sink) const {
  return WriteAtlas(atlas_, camera_.calibration(), config_.features.root_sift, device_, sink);
}

void Mapper::FoundMap(const KeyframeProposal& proposal) {
  // Relocalisation came first: the half-made map is dropped (system.md 8).
  const bool is_overtaken = proposal.relocalisation_done != found_frame_.sequence;
  if (is_overtaken || !MakeFoundingBundle(proposal)) {
    RefuseFounding(proposal);
    return;
  }
  RetireActiveMap(proposal.view);
  settling_rounds_ = 0;
  active_ = MapHandle{};
  newest_ = KeyframeHandle{};
  // Whatever else is missing is seen below.
  (void)evictor_.MakeKeyframeRoom(2, newest_);
  (void)evictor_.MakePointRoom(proposal.num_pairs, newest_);
  if (evictor_.MakeMapRoom()) active_ = atlas_.CreateMap();
  if (!active_) {
    ++counters_.num_maps_refused;
    RefuseFounding(proposal);
    return;
  }
  // The unit of a new map is its median depth in the first view.
  std::vector<double> depths;
  for (const BundlePoint& point : founding_.points) depths.push_back(point.position.norm());
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  const double unit = 1.0 / depths[depths.size() / 2];

  SE3 second = founding_.poses[1].cam_from_world;
  second.translation *= unit;
  const KeyframeHandle reference = atlas_.AddKeyframe(active_, proposal.reference.frame_index,
                                                      proposal.reference.timestamp, SE3{}, proposal.reference.features);
  newest_ =
      atlas_.AddKeyframe(active_, proposal.view.frame_index, proposal.view.timestamp, second, proposal.view.features);
  if (!reference || !newest_) {
    CountRefusedKeyframe();
    std::vector<FeatureSetHandle> sets;
    atlas_.DropMap(active_, &sets);
    active_ = MapHandle{};
    newest_ = KeyframeHandle{};
    RefuseFounding(proposal);
    return;
  }
  created_.clear();
  for (int i = 0; i < proposal.num_pairs; ++i) {
    if (founding_.observations[2 * i].is_outlier || founding_.observations[2 * i + 1].is_outlier) continue;
    const MapPointHandle point =
        atlas_.AddPoint(active_, unit * founding_.points[i].position, atlas_.keyframe(newest_).id);
    if (!point) break;
    atlas_.AddObservation(point, reference, proposal.pairs[i].reference_feature);
    if (!atlas_.AddObservation(point, newest_, proposal.pairs[i].feature)) {
      atlas_.RemovePoint(point);
      continue;
    }
    atlas_.UpdatePoint(point);
    created_.push_back(point);
    trial_.Begin(active_, point);
  }
  counters_.num_keyframes += 2;
  counters_.num_points_created += created_.size();
  PlaceBetween(proposal, reference);
  for (const KeyframeHandle keyframe : {reference, newest_}) {
    // A keyframe that retrieval does not know is not found again; nothing else depends on it.
    (void)retrieval_->Add(atlas_, keyframe);
  }
  founding_proposal_ = proposal.founding_id;
  Report(MapEventKind::kMapCreated, proposal.view, active_);
  Publish(founding_proposal_, 0);
}

void Mapper::RefuseFounding(const KeyframeProposal& proposal) {
  ++counters_.num_foundings_refused;
  device_.ReleaseFeatureSet(proposal.reference.features.set);
  device_.ReleaseFeatureSet(proposal.view.features.set);
  for (int i = 0; i < proposal.num_between; ++i) device_.ReleaseFeatureSet(proposal.between[i].features.set);
  Report(MapEventKind::kMapRefused, proposal.view, active_);
  Publish(founding_proposal_, proposal.founding_id);
}

// Between the two views the scope is taken to have moved evenly; each frame placed corrects the guess for the next.
void Mapper::PlaceBetween(const KeyframeProposal& proposal, KeyframeHandle reference) {
  placed_.clear();
  const SE3 second = atlas_.keyframe(newest_).cam_from_map;
  SE3 last;
  std::uint32_t last_index = proposal.reference.frame_index;
  for (int i = 0; i < proposal.num_between; ++i) {
    const ProposedView& view = proposal.between[i];
    const double share = static_cast<double>(view.frame_index - last_index) /
                         static_cast<double>(proposal.view.frame_index - last_index);
    const SE3 guess = SE3::Exp(share * (second * last.Inverse()).Log()) * last;
    PlacedView placed;
    if (late_placement_.Place(view, guess, reference, atlas_, &placed)) {
      last = placed.cam_from_map;
      last_index = view.frame_index;
      placed_.push_back(std::move(placed));
    }
    device_.ReleaseFeatureSet(view.features.set);
  }
  RefineFounding(reference);
  for (const PlacedView& placed : placed_) {
    LatePose pose;
    pose.frame_index = placed.frame_index;
    pose.reference_keyframe = atlas_.keyframe(reference).id;
    pose.cam_from_reference = placed.cam_from_map * atlas_.keyframe(reference).cam_from_map.Inverse();
    pose.reference_scale = atlas_.KeyframeScale(reference);
    pose.num_inliers = static_cast<int>(placed.sightings.size());
    late_poses_.TryPush(pose);
  }
}

// Two views a short way apart leave the depths uncertain; the frames between them see the same points, too. One bundle
// adjustment of all of them, in which only the reference is held.
void Mapper::RefineFounding(KeyframeHandle reference) {
  if (placed_.empty()) return;
  std::vector<MapPointHandle> points;
  std::map<MapPointHandle, std::int32_t> point_idx;
  founding_.poses.assign(
      {{atlas_.keyframe(reference).cam_from_map, true}, {atlas_.keyframe(newest_).cam_from_map, false}});
  founding_.points.clear();
  founding_.observations.clear();
  const KeyframeHandle keyframes[] = {reference, newest_};
  for (const MapPointHandle handle : created_) {
    const MapPoint& point = atlas_.point(handle);
    const auto idx = static_cast<std::int32_t>(points.size());
    point_idx[handle] = idx;
    points.push_back(handle);
    founding_.points.push_back({point.position, false});
    for (std::int32_t k = 0; k < 2; ++k) {
      const FrameFeatures& features = atlas_.keyframe(keyframes[k]).features;
      const std::int32_t feature = atlas_.FeatureOf(point, keyframes[k]);
      founding_.observations.push_back(
          {k, idx, features.pixel(feature), noise_.SigmaPx(features.keypoints[feature].scale_px), false});
    }
  }
  for (const PlacedView& placed : placed_) {
    const auto pose = static_cast<std::int32_t>(founding_.poses.size());
    founding_.poses.push_back({placed.cam_from_map, false});
    for (const PlacedView::Sighting& sighting : placed.sightings) {
      founding_.observations.push_back({pose, point_idx.at(sighting.point), sighting.pixel, sighting.sigma_px, false});
    }
  }
  BundleOptions options;
  options.max_iterations = kFoundingIterations;
  const Result<BundleSummary> summary = AdjustBundle(camera_, options, &founding_);
  if (!summary.ok() || summary->state != SolveState::kConverged) return;
  atlas_.keyframe(newest_).cam_from_map = founding_.poses[1].cam_from_world;
  for (std::size_t i = 0; i < placed_.size(); ++i) placed_[i].cam_from_map = founding_.poses[i + 2].cam_from_world;
  for (std::size_t i = 0; i < points.size(); ++i) atlas_.point(points[i]).position = founding_.points[i].position;
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Without one of its two keyframes a point of a new map goes.
    if (founding_.observations[2 * i].is_outlier || founding_.observations[2 * i + 1].is_outlier) {
      atlas_.RemovePoint(points[i]);
    } else {
      atlas_.UpdatePoint(points[i]);
    }
  }
}

// Adjusts both views and their points; false when what is left does not carry a map.
bool Mapper::MakeFoundingBundle(const KeyframeProposal& proposal) {
  founding_.poses.assign({{SE3{}, true}, {proposal.cam_from_reference, false}});
  founding_.points.clear();
  founding_.observations.clear();
  for (int i = 0; i < proposal.num_pairs; ++i) {
    const FoundingPair& pair = proposal.pairs[i];
    founding_.points.push_back({pair.point_in_reference, false});
    const Keypoint& a = proposal.reference.features.keypoints[pair.reference_feature];
    const Keypoint& b = proposal.view.features.keypoints[pair.feature];
    founding_.observations.push_back({0, i, {a.x_px, a.y_px}, noise_.SigmaPx(a.scale_px), false});
    founding_.observations.push_back({1, i, {b.x_px, b.y_px}, noise_.SigmaPx(b.scale_px), false});
  }
  BundleOptions options;
  options.max_iterations = kFoundingIterations;
  const Result<BundleSummary> summary = AdjustBundle(camera_, options, &founding_);
  if (!summary.ok() || summary->state != SolveState::kConverged) return false;
  int num_good = 0;
  for (int i = 0; i < proposal.num_pairs; ++i) {
    if (!founding_.observations[2 * i].is_outlier && !founding_.observations[2 * i + 1].is_outlier) ++num_good;
  }
  return num_good >= config_.initialisation.min_points && num_good * 2 >= proposal.num_pairs;
}

// The map that was active is kept when it is worth it.
void Mapper::RetireActiveMap(const ProposedView& view) {
  if (!active_) return;
  Map& map = atlas_.map(active_);
  if (static_cast<int>(map.keyframes.size()) >= config_.mapping.min_map_keyframes) {
    map.status = MapStatus::kStored;
    Report(MapEventKind::kMapStored, view, active_);
    return;
  }
  Report(MapEventKind::kMapDropped, view, active_);
  RemoveFromRetrieval(active_);
  std::vector<FeatureSetHandle> sets;
  atlas_.DropMap(active_, &sets);
  for (const FeatureSetHandle set : sets) Retire(set);
}

void Mapper::RemoveFromRetrieval(MapHandle map) {
  for (const KeyframeHandle keyframe : atlas_.map(map).keyframes) retrieval_->Remove(keyframe);
}

void Mapper::InsertKeyframe(const KeyframeProposal& proposal) {
  // The map may have been joined or moved while the proposal waited.
  SE3 cam_from_map = proposal.cam_from_map;
  MapId map_id = proposal.map_id;
  for (const Reframing& reframing : reframings_) {
    if (reframing.sequence <= proposal.reframing_done || reframing.old_map_id != map_id) continue;
    cam_from_map = TransformPose(cam_from_map, reframing.new_from_old);
    map_id = reframing.new_map_id;
  }
  if (!active_ || atlas_.map(active_).id != map_id) {
    Retire(proposal.view.features.set);
    return;
  }
  const TimePoint start = Now();
  (void)evictor_.MakeKeyframeRoom(1, newest_);
  (void)evictor_.MakePointRoom(config_.features.max, newest_);
  const KeyframeHandle handle = atlas_.AddKeyframe(active_, proposal.view.frame_index, proposal.view.timestamp,
                                                   cam_from_map, proposal.view.features);
  if (!handle) {
    CountRefusedKeyframe();
    Retire(proposal.view.features.set);
    return;
  }
  newest_ = handle;
  ++counters_.num_keyframes;
  for (int i = 0; i < proposal.view.features.num; ++i) {
    const MapPointHandle point = proposal.points[i];
    // Points that were culled or fused while the proposal waited are found again by the search below.
    if (point && atlas_.GetPoint(point) != nullptr && atlas_.AddObservation(point, handle, i))
      atlas_.UpdatePoint(point);
  }
  atlas_.FindCovisible(handle, config_.mapping.min_shared_points, &covisible_);
  created_.clear();
  linker_.Link(handle, covisible_, &atlas_, &created_);
  // What is searched below is searched where the poses put it: first the tracks have their say.
  const LocalBundle::Extent linked{config_.mapping.link_window_keyframes, true, config_.mapping.bundle_iterations};
  if (config_.mapping.link_neighbours > 0) AdjustAround(handle, linked, false);
  atlas_.FindCovisible(handle, config_.mapping.min_shared_points, &covisible_);
  CollectPoints(covisible_, config_.mapping.fuse_neighbours, &candidates_);
  counters_.num_points_fused += fuser_.SearchInto(handle, candidates_, &atlas_);
  // A point seen in a few neighbouring keyframes only helped to place those; when they have settled it has done its work.
  // What the map keeps are the points that can be found again.
  counters_.num_points_culled += static_cast<std::uint64_t>(trial_.CountKeyframe(active_, &atlas_));
  const TimePoint inserted = Now();

  atlas_.FindCovisible(handle, config_.mapping.min_shared_points, &covisible_);
  creator_.Create(handle, covisible_, &atlas_, &created_);
  counters_.num_points_created += created_.size();
  for (const MapPointHandle point : created_) trial_.Begin(active_, point);
  const TimePoint made = Now();

  // What the new keyframe brings is searched in its neighbours.
  candidates_.clear();
  const Keyframe& keyframe = atlas_.keyframe(handle);
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (keyframe.points[i]) candidates_.push_back(keyframe.points[i]);
  }
  for (std::size_t i = 0; i < covisible_.size() && i < static_cast<std::size_t>(config_.mapping.fuse_neighbours); ++i) {
    counters_.num_points_fused += fuser_.SearchInto(covisible_[i].keyframe, candidates_, &atlas_);
  }
  const TimePoint fused = Now();

  if (is_time_boxed_) Publish(founding_proposal_, 0);
  AdjustAround(handle, {config_.mapping.window_keyframes, true, config_.mapping.bundle_iterations}, true);
  const TimePoint adjusted = Now();
  CullKeyframes(handle);
  const TimePoint culled = Now();
  (void)retrieval_->Add(atlas_, handle);
  if (config_.merging.enabled) AskForPlace(handle);
  Publish(founding_proposal_, 0);

  counters_.insert_time += inserted - start;
  counters_.create_time += made - inserted;
  counters_.fuse_time += fused - made;
  counters_.bundle_time += adjusted - fused;
  counters_.cull_time += culled - adjusted;
}

// A failed adjustment leaves the map as it was, one that was stopped keeps what it gained; the next keyframe tries again.
void Mapper::AdjustAround(KeyframeHandle handle, const LocalBundle::Extent& extent, bool may_be_interrupted) {
  const int min_iterations = may_be_interrupted ? kMinBundleIterations : extent.max_iterations;
  const Result<BundleSummary> bundle =
      bundle_.Adjust(handle, extent, LimitsOf(config_.mapping.max_bundle_ms, 1, min_iterations), &atlas_);
  if (bundle.ok() && bundle->state == SolveState::kPartial) ++counters_.num_bundles_stopped;
}

// In real-time mode: the time, and any proposal beside the `num_known` ones that are being worked on.
LocalBundle::Limits Mapper::LimitsOf(int max_ms, int num_known, int min_iterations) const {
  if (!is_time_boxed_) return {};
  const auto is_awaited = [this, num_known, num_left = min_iterations]() mutable {
    return num_left-- <= 0 && link_.num_pending.load(std::memory_order_acquire) > num_known;
  };
  return {clock_, Now() + std::chrono::milliseconds(max_ms), is_awaited};
}

void Mapper::CollectPoints(std::span<const Covisible> keyframes, int max_keyframes, std::vector<MapPointHandle>* out) {
  out->clear();
  for (std::size_t k = 0; k < keyframes.size() && k < static_cast<std::size_t>(max_keyframes); ++k) {
    const Keyframe& keyframe = atlas_.keyframe(keyframes[k].keyframe);
    for (int i = 0; i < keyframe.features.num; ++i) {
      const MapPointHandle point = keyframe.points[i];
      if (!point || is_candidate_[point.index] != 0) continue;
      is_candidate_[point.index] = 1;
      out->push_back(point);
    }
  }
  for (const MapPointHandle point : *out) is_candidate_[point.index] = 0;
}

void Mapper::CullKeyframes(KeyframeHandle newest) {
  atlas_.FindCovisible(newest, config_.mapping.min_shared_points, &covisible_);
  const auto& all = atlas_.map(active_).keyframes;
  for (const Covisible& covisible : covisible_) {
    // The first keyframe holds the frame of reference, the last but one is what the tracker came from.
    if (covisible.keyframe == all.front() || all.size() < 4 || covisible.keyframe == all[all.size() - 2]) continue;
    if (!IsRedundant(covisible.keyframe)) continue;
    // The neighbour that shares most points takes over the frames that were tracked against it.
    std::vector<Covisible> neighbours;
    atlas_.FindCovisible(covisible.keyframe, 1, &neighbours);
    if (neighbours.empty()) continue;
    retrieval_->Remove(covisible.keyframe);
    Retire(atlas_.RemoveKeyframe(covisible.keyframe, neighbours.front().keyframe));
    ++counters_.num_keyframes_culled;
  }
}

// Nearly all its points are seen in at least three other keyframes at the same or a finer scale.
bool Mapper::IsRedundant(KeyframeHandle handle) const {
  const Keyframe& keyframe = atlas_.keyframe(handle);
  if (keyframe.num_points == 0) return true;
  int num_seen_elsewhere = 0;
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i]) continue;
    const MapPoint& point = atlas_.point(keyframe.points[i]);
    const float coarsest = keyframe.features.keypoints[i].scale_px * 1.2f;
    int others = 0;
    for (const Observation& observation : point.observations) {
      if (observation.keyframe == handle) continue;
      const FrameFeatures& features = atlas_.keyframe(observation.keyframe).features;
      if (features.keypoints[observation.feature_idx].scale_px <= coarsest && ++others == 3) break;
    }
    if (others >= 3) ++num_seen_elsewhere;
  }
  return num_seen_elsewhere > config_.mapping.redundant_share * keyframe.num_points;
}

// The tracker has lost its map: does any show this frame? The one that does becomes the active map.
void Mapper::FindPlace(const ProposedView& view) {
  const TimePoint start = Now();
  Relocalisation found;
  relocalisations_tried_.clear();
  const bool is_found = atlas_.keyframes().size() > 0 &&
                        relocaliser_.Relocalise(atlas_, view.features, {}, &found, &relocalisations_tried_);
  device_.ReleaseFeatureSet(view.features.set);
  if (is_found) {
    if (!(found.map == active_)) {
      RetireActiveMap(view);
      active_ = found.map;
      atlas_.map(active_).status = MapStatus::kActive;
    }
    newest_ = found.reference;
    const Keyframe& reference = atlas_.keyframe(found.reference);
    found_frame_ = {found_frame_.sequence + 1, view.frame_index, found.cam_from_map};
    LatePose pose;
    pose.frame_index = view.frame_index;
    pose.reference_keyframe = reference.id;
    pose.cam_from_reference = found.cam_from_map * reference.cam_from_map.Inverse();
    pose.reference_scale = atlas_.KeyframeScale(found.reference);
    pose.num_inliers = found.counts.num_inliers;
    late_poses_.TryPush(pose);
    Publish(founding_proposal_, 0);
  }
  const Duration duration = Now() - start;
  counters_.relocalisation_time += duration;
  ++counters_.num_placeless;
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
  link_.num_placeless_done.fetch_add(1, std::memory_order_release);
}

// Does the keyframe show what another map, or another part of this one, already holds?
void Mapper::AskForPlace(KeyframeHandle keyframe) {
  PlaceTask* task = places_.Free();
  if (skipped_) ++counters_.num_places_skipped;
  skipped_ = task == nullptr ? keyframe : KeyframeHandle{};
  if (task == nullptr) return;
  const TimePoint start = Now();
  task->noise = noise_;
  const bool is_question = scout_.Begin(atlas_, keyframe, task);
  task->mapping_duration = Now() - start;
  counters_.asking_time += task->mapping_duration;
  if (is_question) {
    places_.Ask();
  } else {
    EndQuestion(*task);
  }
}

// When there is nothing else to do.
bool Mapper::AskForSkipped() {
  if (!skipped_ || places_.is_out()) return false;
  const KeyframeHandle keyframe = std::exchange(skipped_, KeyframeHandle{});
  const Keyframe* skipped = atlas_.GetKeyframe(keyframe);
  if (skipped == nullptr || skipped->map != active_) {
    ++counters_.num_places_skipped;
    return false;
  }
  AskForPlace(keyframe);
  return true;
}

bool Mapper::TakeAnswer() {
  PlaceTask* task = places_.Answered();
  if (task == nullptr) return false;
  if (task->stage == PlaceTask::Stage::kRetrieve) {
    const Keyframe* keyframe = atlas_.GetKeyframe(task->keyframe);
    if (keyframe == nullptr || keyframe->map != active_) {
      ++counters_.num_places_skipped;
    } else {
      const TimePoint start = Now();
      const bool is_question = scout_.GoOn(atlas_, task);
      const Duration duration = Now() - start;
      task->mapping_duration += duration;
      counters_.asking_time += duration;
      if (is_question) {
        places_.AskOn();
        return true;
      }
    }
  }
  EndQuestion(*task);
  places_.Take();
  return true;
}

void Mapper::EndQuestion(const PlaceTask& task) {
  counters_.num_place_points_left_out = scout_.num_points_left_out();
  counters_.place_time += task.mapping_duration + task.merging_duration;
  for (const CommonAreaCounts& counts : task.report.tried) {
    if (counts.verdict != CommonAreaVerdict::kAccepted) ReportRejection(task, counts);
  }
  if (task.is_known) JoinMaps(task);
}

// Local bundle adjustment, settling and changes of unit since the question was put are made up for by the plan itself
// (merge_plan.h). Maps are joined here alone and one question is out at a time, so what else may have happened is that
// keyframes have gone, or that tracking has found itself in another map or begun a new one. Then the answer is dropped:
// where tracking is now, the next keyframe asks again.
void Mapper::JoinMaps(const PlaceTask& task) {
  const TimePoint start = Now();
  const TimePoint deadline =
      is_time_boxed_ ? start + std::chrono::milliseconds(config_.merging.max_milliseconds) : kNoDeadline;
  MergePlan plan = MakeMergePlan(task.area);
  plan.tracked = newest_;
  MergeOutcome outcome;
  const Keyframe* a = atlas_.GetKeyframe(plan.keyframe_a);
  const Status status = a == nullptr || a->map != active_
                            ? FailedPrecondition("join: tracking has left the map of the plan")
                            : merger_.Apply(plan, &atlas_, is_time_boxed_ ? clock_ : nullptr, deadline, &outcome);
  if (!status.ok()) {
    const bool is_outdated =
        status.code() == StatusCode::kFailedPrecondition || status.code() == StatusCode::kInvalidArgument;
    ++(is_outdated ? counters_.num_merges_outdated : counters_.num_loops_left_open);
    CommonAreaCounts counts = task.area.counts;
    counts.verdict = is_outdated ? CommonAreaVerdict::kOutdated : CommonAreaVerdict::kNotJoined;
    ReportRejection(task, counts);
    counters_.merge_time += Now() - start;
    return;
  }
  if (!outcome.is_loop) trial_.Join(outcome.map, outcome.absorbed);
  active_ = outcome.map;
  settling_rounds_ = config_.merging.settling_rounds;
  Reframe(outcome.reframing);
  const TimePoint joined = Now();
  counters_.merge_time += joined - start;
  MapEvent event;
  event.kind = outcome.is_loop ? MapEventKind::kLoopClosed : MapEventKind::kMerged;
  event.frame_index = task.frame_index;
  event.timestamp = task.timestamp;
  event.map_id = outcome.map_id;
  event.other_map_id = outcome.is_loop ? kNoId : outcome.absorbed_map_id;
  event.num_keyframes = static_cast<int>(atlas_.map(active_).keyframes.size());
  event.num_points = atlas_.map(active_).num_points;
  event.place = task.area.counts;
  event.duration = joined - start;
  events_.TryPush(event);
  Publish(founding_proposal_, 0);
}

void Mapper::ReportRejection(const PlaceTask& task, const CommonAreaCounts& counts) {
  MapEvent event;
  event.kind = MapEventKind::kMergeRejected;
  event.frame_index = task.frame_index;
  event.timestamp = task.timestamp;
  event.map_id = counts.map_a;
  event.other_map_id = counts.map_b;
  event.place = counts;
  events_.TryPush(event);
}

void Mapper::Reframe(const Reframing& reframing) {
  if (reframings_.full()) {
    std::move(reframings_.begin() + 1, reframings_.end(), reframings_.begin());
    reframings_.SwapErase(reframings_.size() - 1);
  }
  HAUSTRA_CHECK(reframings_.PushBack(reframing));
  reframings_[reframings_.size() - 1].sequence = ++counters_.num_reframings;
}

// After a join, when there is nothing else to do: what the seam made known spreads over the map around it, a slice of
// bundle adjustment at a time.
bool Mapper::Settle() {
  if (settling_rounds_ == 0) return false;
  --settling_rounds_;
  const TimePoint start = Now();
  const MergingConfig& options = config_.merging;
  const LocalBundle::Extent extent{options.settling_keyframes, false, options.settling_iterations};
  const SE3 old_pose = atlas_.keyframe(newest_).cam_from_map;
  const Result<BundleSummary> summary =
      bundle_.Adjust(newest_, extent, LimitsOf(options.settling_milliseconds, 0, 0), &atlas_);
  const bool is_interrupted = link_.proposals.Front() != nullptr;
  if (!summary.ok() || summary->state == SolveState::kNone) {
    if (!is_interrupted) settling_rounds_ = 0;
    return true;
  }
  if (!is_interrupted && summary->final_cost > kSettledShare * summary->initial_cost) settling_rounds_ = 0;
  const MapId map_id = atlas_.map(active_).id;
  Reframe({0, map_id, map_id, Sim3(atlas_.keyframe(newest_).cam_from_map).Inverse() * Sim3(old_pose)});
  Publish(founding_proposal_, 0);
  counters_.settle_time += Now() - start;
  return true;
}

PoolUse Mapper::pool_use() const {
  return {keyframes_in_use_.load(std::memory_order_relaxed), points_in_use_.load(std::memory_order_relaxed),
          maps_in_use_.load(std::memory_order_relaxed), ids_in_use_.load(std::memory_order_relaxed),
          static_cast<std::uint32_t>(device_.num_free_feature_sets())};
}

void Mapper::Publish(std::uint64_t founding_proposal, std::uint64_t refused_proposal) {
  LocalMap& snapshot = link_.snapshots.WriteSlot();
  snapshot.version = ++version_;
  snapshot.founding_proposal = founding_proposal;
  snapshot.refused_proposal = refused_proposal;
  snapshot.found_frame = found_frame_;
  snapshot.reframings = reframings_;
  if (active_ && newest_) {
    snapshot.map_id = atlas_.map(active_).id;
    builder_.Build(atlas_, newest_, &snapshot);
    counters_.num_snapshots_cut = builder_.num_cut();
  } else {
    snapshot.map_id = kNoId;
    snapshot.keyframes.Clear();
    snapshot.num_points = 0;
  }
  link_.snapshots.Publish();
  keyframes_in_use_.store(atlas_.keyframes().size(), std::memory_order_relaxed);
  points_in_use_.store(atlas_.points().size(), std::memory_order_relaxed);
  maps_in_use_.store(atlas_.maps().size(), std::memory_order_relaxed);
  ids_in_use_.store(atlas_.num_keyframe_ids(), std::memory_order_relaxed);
}

void Mapper::ReleaseRetired() {
  const std::uint64_t done = link_.version_done.load(std::memory_order_acquire);
  std::size_t kept = 0;
  for (const RetiredSet& retired : retired_) {
    if (retired.version <= done && retired.num_asked <= places_.num_taken()) {
      device_.ReleaseFeatureSet(retired.set);
    } else {
      retired_[kept++] = retired;
    }
  }
  retired_.resize(kept);
}

void Mapper::CountRefusedKeyframe() {
  ++counters_.num_keyframes_refused;
  if (atlas_.num_keyframe_ids() >= static_cast<KeyframeId>(atlas_.capacity().max_keyframe_ids)) {
    ++counters_.num_keyframe_ids_refused;
  }
}

void Mapper::ReportEviction(MapHandle map) { Report(MapEventKind::kMapEvicted, *current_view_, map); }

void Mapper::Report(MapEventKind kind, const ProposedView& view, MapHandle map) {
  MapEvent event;
  event.kind = kind;
  event.frame_index = view.frame_index;
  event.timestamp = view.timestamp;
  if (map) {
    event.map_id = atlas_.map(map).id;
    event.num_keyframes = static_cast<int>(atlas_.map(map).keyframes.size());
    event.num_points = atlas_.map(map).num_points;
  }
  events_.TryPush(event);
}

}  // namespace haustra
