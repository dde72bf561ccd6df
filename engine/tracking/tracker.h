// Answers every frame with a camera pose or an honest 'lost'. Reads the newest LocalMap
// snapshot, never the atlas; proposes keyframes and new maps through a ring and never waits for the mapper.
//   tracking: predict, guided search of the last frame's points, pose; guided search of the local map, pose
//             (pose_search.h); too little found: brute force against the local map (pose_recovery.h)
//   lost:     the pose that the mapper has answered with, if any; else the same brute force, a request to find the
//             frame in any map, and the initialisation of a new map (proposer.h), all on every frame
// What it knows between two frames is a state of tracker_state.h, which the mapper's replies change (map_reply.h).
// A frame with a deadline walks down the ladder of engine/scheduler before it misses it; what the device has not
// answered by then is left for the next frame to collect, and the pose is the prediction. Full: without a feature set
// the frame is answered as a damaged one and counted.
// thread-bound(tracking); rt-safe after construction: no allocation, no lock, no wait but for the vision device.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "engine/atlas/local_map.h"
#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/scheduler/frame_budget.h"
#include "engine/scheduler/lane_wait.h"
#include "engine/tracking/flow_chain.h"
#include "engine/tracking/frame_extractor.h"
#include "engine/tracking/frame_result.h"
#include "engine/tracking/initialiser.h"
#include "engine/tracking/mark_watch.h"
#include "engine/tracking/noise_meter.h"
#include "engine/tracking/overlay_watch.h"
#include "engine/tracking/pose_recovery.h"
#include "engine/tracking/pose_search.h"
#include "engine/tracking/proposer.h"
#include "engine/tracking/tracker_state.h"
#include "engine/tracking/tracking_link.h"
#include "hal/frame_source.h"
#include "hal/vision_device.h"

namespace haustra {

class Tracker {
 public:
  // clock: see FrameBudget.
  Tracker(const EngineConfig& config, const CameraModel& camera, SceneRegion& scene, VisionDevice& device,
          TrackingLink& link, const Clock* clock, std::pmr::memory_resource* memory = std::pmr::get_default_resource());
  // A line for the views that tracking keeps in the arena, one for its workspaces on the heap, both fixed at
  // construction.
  static MemoryPlan PlanMemory(const EngineConfig& config);
  ~Tracker();
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  // One frame, to be answered by the deadline (kNoDeadline: with all that can be had). Never fails: what goes wrong is
  // in the result. The frame's pixels stay until MayReleaseFrame.
  FrameResult Track(const Frame& frame, TimePoint deadline);
  // False: the device still reads the last frame after `deadline`. Always true after a frame without a deadline.
  bool MayReleaseFrame(TimePoint deadline) { return lane_.Drain(deadline); }
  Status ServeThisThread() { return device_.ServeThisThread(Lane::kTracking); }
  // A frame that could not be read: counts as lost, breaks nothing.
  FrameResult SkipDamaged(std::uint32_t frame_index, TimePoint timestamp);

  // After Track: where the features of its frame lie that agree with its pose, px, in the order of the features; of
  // more than `to` has room for an even selection. Returns how many. None without a pose that was measured in this
  // frame. rt-safe.
  std::size_t MatchedPixels(std::span<Eigen::Vector2f> to) const;
  // Of the last frame, as of its answer.
  const MarkSightings& mark_sightings() const { return marks_.sightings(); }

  TrackingState state() const { return StateOf(state_); }
  // Frames for which the device had no feature set left. Any thread.
  std::uint64_t num_sets_refused() const { return extractor_.num_sets_refused(); }

 private:
  enum class Outcome {
    kPose,    // and the state is Tracking
    kNoPose,  // and the state is another
    kNoTime,  // nobody knows; the state is what it was, or the start that was tried
  };

  void MeasurePeriod(const Frame& frame);
  int FramesWithin(double time_ms) const;
  int MaxVelocityAge() const;
  void HearMapper();
  bool NeedsAllFeatures() const;
  bool MayFoundMap() const;
  Outcome Measure(const Frame& frame, FrameResult* result);

  Outcome TrackMap(FrameResult* result);
  TrackingReason SearchGuided(const Tracking& tracking, FrameResult* result);
  bool IsPlausibleMotion(const SE3& predicted) const;
  SE3 Predict(const Tracking& tracking) const;

  Outcome FindPose(FrameResult* result);
  Outcome TryStart(const Start& start, FrameResult* result);
  Outcome BeginMap(Lost* lost, FrameResult* result);

  void AnswerWithPose(FrameResult* result);
  void AnswerWithoutMeasurement(FrameResult* result);
  void MeasureNoise(const Tracking& tracking);
  void WatchOverlay(MapId map_id);
  void ConsiderKeyframe(const LocalKeyframe& reference, Tracking* tracking, FrameResult* result);
  void KeepFrame(Tracking* tracking);
  bool IsViewOfNewMap(TrackingReason reason) const;
  void KeepFoundingFrame(TrackingReason reason);
  bool IsHeldByMap() const;
  bool IsDeniedByFlow(MapId map_id, bool is_tracked) const;
  void AnchorChain(const FrameResult& result);
  void TellMapper(const FrameResult& result, const ImageView& image);
  void ForgetLastFrame();
  void DropFrame();
  void SetLost();

  const LocalMap& local_map() const { return link_.snapshots.ReadSlot(); }

  const EngineConfig& config_;
  const CameraModel& camera_;
  SceneRegion& scene_;
  VisionDevice& device_;
  TrackingLink& link_;

  TrackerState state_ = Lost{};
  RepliesHeard heard_;
  ProposedView current_;
  // The last frame that was looked at. A damaged one in between is one that did not come.
  struct Arrival {
    std::uint32_t frame_index = 0;
    TimePoint timestamp;
  };
  std::optional<Arrival> last_arrival_;
  Duration period_ = std::chrono::milliseconds(40);  // of the frames; of a source that has shown none yet a usual one
  bool is_set_given_ = false;                        // the current feature set founds a map, or may: no longer ours
  LastFrame last_;
  bool owns_last_set_ = false;

  FrameBudget budget_;
  LaneWait lane_;
  NoiseMeter noise_meter_;
  MapSight sight_;
  OverlayWatch overlay_;
  FlowChain chain_;
  int anchor_inliers_ = 0;  // of the frame where the chain begins
  FrameExtractor extractor_;
  Initialiser initialiser_;
  PoseSearch search_;
  PoseRecovery recovery_;
  MarkWatch marks_;
  Proposer proposer_;

  TimePoint last_timestamp_;  // of the last frame with a pose
  SE3 overlay_pose_;          // of the frame that overlay_ keeps, in map overlay_map_
  MapId overlay_map_ = kNoId;
  std::vector<OverlayWatch::Tracked> tracked_;  // workspace
};

}  // namespace haustra
