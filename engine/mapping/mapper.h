// The one writer of the atlas (system.md 7): takes proposals from the tracker, founds maps, inserts keyframes, makes,
// joins and culls points, adjusts the window, culls keyframes, and publishes a LocalMap snapshot after every proposal
// that changed something. Looks for lost frames in all maps and makes the map that shows one the active one. Asks the
// recogniser (engine/place) whether a new keyframe shows a known place, and joins maps when the answer comes, between
// two keyframes: it never waits for it. In real-time mode the tracker proposes nothing but what it needs while the mapper
// is busy: new points are published before they are adjusted, and a waiting proposal ends the bundle after a few steps. One question is out at a time; of the keyframes that come meanwhile the newest
// is asked about next. Feature sets that a question names are kept until its answer was taken. Full pools: evictor.h;
// full rings: the newest event, late pose or proposal is lost and counted by its ring. thread-bound(mapping). Uses the
// heap (solvers), inside bounds set by the windows.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <memory_resource>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/atlas/local_map.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/io/byte_sink.h"
#include "engine/io/saved_atlas.h"
#include "engine/mapping/evictor.h"
#include "engine/mapping/late_placement.h"
#include "engine/mapping/local_bundle.h"
#include "engine/mapping/map_event.h"
#include "engine/mapping/point_creation.h"
#include "engine/mapping/point_fusion.h"
#include "engine/mapping/point_trial.h"
#include "engine/mapping/track_linker.h"
#include "engine/merging/merger.h"
#include "engine/noise_model.h"
#include "engine/place/place_mailbox.h"
#include "engine/place/place_scout.h"
#include "engine/place/relocaliser.h"
#include "engine/place/retrieval.h"
#include "engine/place/vocabulary.h"
#include "engine/tracking/tracker.h"
#include "hal/clock.h"
#include "hal/vision_device.h"

namespace haustra {

struct MapperCounters {
  std::uint64_t num_keyframes = 0;
  std::uint64_t num_keyframes_culled = 0;
  std::uint64_t num_keyframes_refused = 0;     // pool full, and nothing in it might go
  std::uint64_t num_keyframe_ids_refused = 0;  // of these, because all ids had been given
  std::uint64_t num_maps_refused = 0;          // foundings for which the table of maps had no room
  std::uint64_t num_points_created = 0;
  std::uint64_t num_points_culled = 0;
  std::uint64_t num_points_fused = 0;
  std::uint64_t num_bundles_stopped = 0;  // before they were done: for want of time, or for a proposal that waited
  std::uint64_t num_snapshots_cut = 0;  // that had no room for all points of their window
  std::uint64_t num_foundings_refused = 0;
  std::uint64_t num_placeless = 0;              // frames without a pose whose place was looked for
  std::uint64_t num_places_skipped = 0;         // keyframes whose place was not looked for: the recogniser was busy
  std::uint64_t num_place_points_left_out = 0;  // of wider groups, for want of room in a question
  std::uint64_t num_merges_outdated = 0;        // answers that came too late to be applied
  std::uint64_t num_loops_left_open = 0;        // for want of time; the map is as it was
  std::uint64_t num_reframings = 0;             // times that a map was moved: the epoch of what is published
  // Time spent, for the stage table; only measured when a clock is given.
  Duration insert_time{0}, create_time{0}, fuse_time{0}, bundle_time{0}, cull_time{0}, merge_time{0};
  Duration asking_time{0};  // of place recognition: what is done on the mapping thread
  Duration place_time{0};   // all of it, wherever it ran
  Duration relocalisation_time{0}, settle_time{0};
};

// How many entries of each pool are in use.
struct PoolUse {
  std::uint32_t keyframes = 0;
  std::uint32_t map_points = 0;
  std::uint32_t maps = 0;
  std::uint32_t keyframe_ids = 0;
  std::uint32_t free_feature_sets = 0;
};

class Mapper {
 public:
  // `vocabulary` may be null unless config.place.retrieval asks for one (make_retrieval.h); it outlives the mapper.
  // `clock` may be null: then nothing is timed and bundle adjustment is bounded by iterations alone (sequential mode).
  // `places` leads to the recogniser.
  Mapper(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, TrackingLink& link,
         PlaceMailbox& places, const Clock* clock, bool is_time_boxed, const Vocabulary* vocabulary,
         std::pmr::memory_resource* memory = std::pmr::get_default_resource());
  // Lines of the atlas and the rings, which are taken from `memory`, and of what mapping keeps on the heap.
  static MemoryPlan PlanMemory(const EngineConfig& config);

  // Takes the recogniser's answer, or else works on the oldest proposal. False when there is nothing to do.
  bool Step();

  // Before the first step: takes the maps of a file as stored ones, in which lost frames and known places are looked
  // for like in those of this run. Status of RestoreAtlas.
  Status LoadAtlas(const SavedAtlas& saved);
  // Between two steps, or after the mapping thread has ended. Status of WriteAtlas.
  Status SaveAtlas(ByteSink& sink) const;

  const Atlas& atlas() const { return atlas_; }
  const MapperCounters& counters() const { return counters_; }
  // As of the last snapshot. thread-safe; each figure for itself.
  PoolUse pool_use() const;
  const EvictionCounters& evictions() const { return evictor_.counters(); }
  // Events since the last call, oldest first; the same thread as Step, or after the mapping thread has ended.
  SpscRing<MapEvent>& events() { return events_; }
  // Poses of frames that were answered before their map stood; read like events.
  SpscRing<LatePose>& late_poses() { return late_poses_; }

 private:
  void FoundMap(const KeyframeProposal& proposal);
  bool MakeFoundingBundle(const KeyframeProposal& proposal);
  void PlaceBetween(const KeyframeProposal& proposal, KeyframeHandle reference);
  void RefineFounding(KeyframeHandle reference);
  void RefuseFounding(const KeyframeProposal& proposal);
  void RetireActiveMap(const ProposedView& view);
  void FindPlace(const ProposedView& view);
  void InsertKeyframe(const KeyframeProposal& proposal);
  void AdjustAround(KeyframeHandle handle, const LocalBundle::Extent& extent, bool may_be_interrupted);
  LocalBundle::Limits LimitsOf(int max_ms, int num_known, int min_iterations) const;
  void CollectPoints(std::span<const Covisible> keyframes, int max_keyframes, std::vector<MapPointHandle>* out);
  void CullKeyframes(KeyframeHandle newest);
  bool IsRedundant(KeyframeHandle handle) const;
  void AskForPlace(KeyframeHandle keyframe);
  bool AskForSkipped();
  bool TakeAnswer();
  void EndQuestion(const PlaceTask& task);
  void JoinMaps(const PlaceTask& task);
  void ReportRejection(const PlaceTask& task, const CommonAreaCounts& counts);
  void Reframe(const Reframing& reframing);
  bool Settle();
  void RemoveFromRetrieval(MapHandle map);
  void Publish(std::uint64_t founding_proposal, std::uint64_t refused_proposal);
  void Retire(FeatureSetHandle set) { retired_.push_back({version_ + 1, places_.num_asked(), set}); }
  void ReleaseRetired();
  void CountRefusedKeyframe();
  void ReportEviction(MapHandle map);
  void Report(MapEventKind kind, const ProposedView& view, MapHandle map);
  TimePoint Now() const { return clock_ == nullptr ? TimePoint{} : clock_->Now(); }

  const EngineConfig& config_;
  const CameraModel& camera_;
  VisionDevice& device_;
  TrackingLink& link_;
  PlaceMailbox& places_;
  const Clock* clock_;
  bool is_time_boxed_;
  NoiseModel noise_;  // of the last proposal
  Atlas atlas_;
  LocalMapBuilder builder_;
  PointCreator creator_;
  PointFuser fuser_;
  PointTrial trial_;
  TrackLinker linker_;
  SchurBundleAdjuster adjuster_;  // of windows and seams: its memory is that of the largest of them
  LocalBundle bundle_;
  LatePlacement late_placement_;
  std::unique_ptr<KeyframeRetrieval> retrieval_;
  Relocaliser relocaliser_;
  PlaceScout scout_;
  Merger merger_;
  Evictor evictor_;
  SpscRing<MapEvent> events_;
  SpscRing<LatePose> late_poses_;
  MapperCounters counters_;

  std::atomic<std::uint32_t> keyframes_in_use_{0};
  std::atomic<std::uint32_t> points_in_use_{0};
  std::atomic<std::uint32_t> maps_in_use_{0};
  std::atomic<std::uint32_t> ids_in_use_{0};

  MapHandle active_;
  KeyframeHandle newest_;
  std::uint64_t version_ = 0;
  std::uint64_t founding_proposal_ = 0;
  FixedVector<Reframing, kMaxReframings> reframings_;  // the latest ones, oldest first
  int settling_rounds_ = 0;                            // left after the last join
  FoundFrame found_frame_;
  const ProposedView* current_view_ = nullptr;  // of the proposal being worked on
  KeyframeHandle skipped_;                      // the newest one that the recogniser was too busy for
  std::vector<RelocalisationCounts> relocalisations_tried_;
  struct RetiredSet {
    std::uint64_t version;    // first snapshot that does not refer to it
    std::uint64_t num_asked;  // questions before it went: any of them may name it
    FeatureSetHandle set;
  };
  std::vector<RetiredSet> retired_;
  std::vector<MapPointHandle> candidates_;
  std::vector<MapPointHandle> created_;
  std::vector<Covisible> covisible_;
  std::vector<std::uint8_t> is_candidate_;  // by point slot
  BundleProblem founding_;
  std::vector<PlacedView> placed_;  // between the founding views
};

}  // namespace haustra
