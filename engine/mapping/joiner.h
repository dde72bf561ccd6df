// Asks the recogniser (engine/place) whether keyframes show a known place, and joins maps or closes loops when it says
// so (engine/merging). One question is out at a time, and it is out until the join that it leads to is done; of the
// keyframes that come meanwhile the newest is asked about next. A join is made in slices, in sequential mode in one.
// When tracking leaves the map it ends where it is (merger.h says why it may); one that has moved nothing ends when a
// map is built anew (relief_check.h). After a join the map around the seam settles by bundle adjustment in slices, when
// there is nothing else to do and tracking is there. Never waits for the recogniser. thread-bound(mapping); uses the
// heap (solvers).
#pragma once

#include "engine/mapping/local_bundle.h"
#include "engine/mapping/map_event.h"
#include "engine/mapping/mapping_state.h"
#include "engine/mapping/point_trial.h"
#include "engine/mapping/snapshot_publisher.h"
#include "engine/merging/merger.h"
#include "engine/place/place_mailbox.h"
#include "engine/place/place_scout.h"
#include "engine/place/retrieval.h"
#include "hal/core/spsc_ring.h"

namespace haustra {

class Joiner {
 public:
  struct Parts {
    PlaceMailbox& places;
    SnapshotPublisher& publisher;
    KeyframeRetrieval& retrieval;
    PointTrial& trial;
    LocalBundle& bundle;
    SchurBundleAdjuster& adjuster;
    SpscRing<MapEvent>& events;
  };
  // All of them outlive it.
  Joiner(MappingState& state, Parts parts);

  // Does the keyframe show what another map, or another part of this one, already holds? When a question is out the
  // keyframe is kept for later.
  void Ask(KeyframeHandle keyframe);
  // Keeps the keyframe for later.
  void PutOff(KeyframeHandle keyframe);
  // Takes the recogniser's answer, and begins the join when it says so. False: there is none.
  bool TakeAnswer();

  // A join has begun that is not done.
  bool is_joining() const { return is_joining_; }
  // Its next slice; publishes when the map was moved, and when it is done.
  void GoOn();

  // For when there is nothing else to do. False: nothing was done.
  bool AskForSkipped();
  bool SettleSeam();

 private:
  void EndQuestion(const PlaceTask& task);
  void BeginJoin(const PlaceTask& task);
  void RefuseJoin(const PlaceTask& task, const Status& status);
  void EndJoin(const PlaceTask& task);
  JoinLimits Limits(TimePoint start) const;
  // A map was built anew since the question was put: it was asked about another shape.
  bool IsTurned() const { return state_.counters.num_reliefs_turned != num_turns_asked_; }
  void ReportRejection(const PlaceTask& task, const CommonAreaCounts& counts);

  MappingState& state_;
  PlaceMailbox& places_;
  SnapshotPublisher& publisher_;
  PointTrial& trial_;
  LocalBundle& bundle_;
  SpscRing<MapEvent>& events_;
  PlaceScout scout_;
  Merger merger_;
  std::uint64_t num_turns_asked_ = 0;  // MapperCounters::num_reliefs_turned when the atlas was copied for the question
  bool is_joining_ = false;
  MapHandle join_map_;        // where tracking is as long as the join goes on
  Duration joining_time_{0};  // of all slices so far
  int settling_rounds_ = 0;   // left after the last join
  MapHandle settling_map_;    // in it
  KeyframeHandle skipped_;    // the newest one that the recogniser was too busy for
};

}  // namespace haustra
