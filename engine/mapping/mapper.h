// The one writer of the atlas: takes proposals from the tracker, founds maps, inserts keyframes, makes,
// joins and culls points, adjusts the window, culls keyframes, and publishes a LocalMap snapshot after every proposal
// that changed something. Looks for lost frames in all maps and makes the map that shows one the active one. Asks the
// recogniser (engine/place) whether a new keyframe shows a known place, and joins maps when the answer comes: it never
// waits for it. In real-time mode the tracker proposes nothing but what it needs while the mapper is busy: a join is
// made in slices that take turns with the proposals (joiner.h, merger.h), so one that comes waits for a slice at most;
// new points are published before they are adjusted, and a waiting proposal ends the bundle after a few steps. One
// question is out at a time; of the keyframes that come meanwhile the newest is asked about next. Feature sets that a
// question names are kept until its answer was taken. Full pools: evictor.h; full rings: the newest event, late pose or
// proposal is lost and counted by its ring. thread-bound(mapping). Uses the heap (solvers), inside bounds set by the
// windows.
#pragma once

#include <memory>
#include <memory_resource>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/io/saved_atlas.h"
#include "engine/mapping/evictor.h"
#include "engine/mapping/founder.h"
#include "engine/mapping/joiner.h"
#include "engine/mapping/keyframe_inserter.h"
#include "engine/mapping/late_placement.h"
#include "engine/mapping/local_bundle.h"
#include "engine/mapping/map_event.h"
#include "engine/mapping/mapping_state.h"
#include "engine/mapping/mark_keeper.h"
#include "engine/mapping/point_trial.h"
#include "engine/mapping/snapshot_publisher.h"
#include "engine/place/place_mailbox.h"
#include "engine/place/relocaliser.h"
#include "engine/place/retrieval.h"
#include "engine/place/vocabulary.h"
#include "engine/tracking/tracking_link.h"
#include "hal/clock.h"
#include "hal/core/byte_sink.h"
#include "hal/vision_device.h"

namespace haustra {

// kNeeded: what tracking has proposed, answers that are due, and a join that has begun. The maps are then whole, and
// all that only makes them better waits: new questions about places, settling, new depth.
enum class MapWork { kAll, kNeeded };

class Mapper {
 public:
  // `vocabulary` may be null unless config.place.retrieval asks for one (make_retrieval.h); it outlives the mapper.
  // `clock` may be null: then nothing is timed and bundle adjustment is bounded by iterations alone (sequential mode).
  // `places` leads to the recogniser.
  Mapper(const EngineConfig& config, const CameraModel& camera, const SceneRegion& scene, VisionDevice& device,
         TrackingLink& link, PlaceMailbox& places, const Clock* clock, bool is_time_boxed, const Vocabulary* vocabulary,
         std::pmr::memory_resource* memory = std::pmr::get_default_resource());
  // Lines of the atlas and the rings, which are taken from `memory`, and of what mapping keeps on the heap.
  static MemoryPlan PlanMemory(const EngineConfig& config);

  // Takes the recogniser's answer, or else works on the oldest proposal. False when there is nothing to do, or when the
  // tracker has left no room for a reply (tracking_link.h).
  bool Step(MapWork work = MapWork::kAll);

  // Before the first step: takes the maps of a file as stored ones, in which lost frames and known places are looked
  // for like in those of this run. Status of RestoreAtlas.
  Status LoadAtlas(const SavedAtlas& saved);
  // Engine::BeginSession.
  void BeginSession() { marks_.BeginSession(); }
  // Between two steps: MarkKeeper::Set and Remove, and the tracker hears of it.
  Result<MarkId> SetMark(const MarkRequest& request);
  Status RemoveMark(std::string_view label);

  // Between two steps, or after the mapping thread has ended. Status of WriteAtlas.
  Status SaveAtlas(ByteSink& sink) const;

  const Atlas& atlas() const { return state_.atlas; }
  const MapperCounters& counters() const { return state_.counters; }
  // As of the last snapshot. thread-safe; each figure for itself.
  PoolUse pool_use() const { return publisher_.pool_use(); }
  const EvictionCounters& evictions() const { return evictor_.counters(); }
  // Events, oldest first. Step fills the ring, and one thread empties it, whichever it is.
  SpscRing<MapEvent>& events() { return events_; }
  // Poses of frames that were answered before their map stood; read like events.
  SpscRing<LatePose>& late_poses() { return late_poses_; }

 private:
  void FoundMap(const KeyframeProposal& proposal);
  bool HasRoomForMap();
  void RefuseFounding(const KeyframeProposal& proposal);
  void RetireActiveMap(const ProposedView& view);
  void RemoveFromRetrieval(MapHandle map);
  void InsertKeyframe(const KeyframeProposal& proposal, MapWork work);
  void FindFrame(const ProposedView& view);
  void Report(MapEventKind kind, const ProposedView& view, MapHandle map);

  MappingState state_;
  std::unique_ptr<KeyframeRetrieval> retrieval_;
  SnapshotPublisher publisher_;
  Evictor evictor_;
  PointTrial trial_;
  SchurBundleAdjuster adjuster_;  // of windows and seams: its memory is that of the largest of them
  LocalBundle bundle_;
  SpscRing<MapEvent> events_;
  SpscRing<LatePose> late_poses_;
  MarkKeeper marks_;
  Founder founder_;
  KeyframeInserter inserter_;
  Joiner joiner_;
  Relocaliser relocaliser_;
  bool is_joins_turn_ = false;                  // the last step was a proposal's
  const ProposedView* current_view_ = nullptr;  // of the proposal being worked on
  std::vector<RelocalisationCounts> relocalisations_tried_;
};

}  // namespace haustra
