// Answers every frame with a camera pose or an honest 'lost' (system.md 5, 6 and 8). Reads the newest LocalMap
// snapshot, never the atlas; proposes keyframes and new maps through a ring and never waits for the mapper.
//   tracking: predict, guided search of the last frame's points, pose; guided search of the local map, pose;
//             too little found: brute force against the local map's descriptors, RANSAC, guided search, pose
//   lost:     the same brute force against the last window, a request to find the frame in any map (the mapper
//             answers with a snapshot of that place), and the initialisation of a new map, all on every frame
// A frame with a deadline walks down the ladder of engine/scheduler before it misses it; what the device has not
// answered by then is left for the next frame to collect, and the pose is the prediction. Full: without a feature set
// the frame is answered as a damaged one and counted; a proposal that finds the ring full is given up and counted: at
// most two wait at a time (a keyframe or a frame without a place, and a new map).
// thread-bound(tracking); rt-safe after construction: no allocation, no lock, no wait but for the vision device.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/atlas/local_map.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/absolute_pose.h"
#include "engine/geometry/rng.h"
#include "engine/optim/pose_optimizer.h"
#include "engine/scheduler/frame_budget.h"
#include "engine/scheduler/lane_wait.h"
#include "engine/tracking/frame_result.h"
#include "engine/tracking/initialiser.h"
#include "engine/tracking/keyframe_proposal.h"
#include "engine/tracking/noise_meter.h"
#include "engine/tracking/overlay_watch.h"
#include "engine/tracking/tracking_link.h"
#include "hal/frame_source.h"
#include "hal/vision_device.h"

namespace haustra {

class Tracker {
 public:
  // scene_share: see Initialiser. clock: see FrameBudget.
  Tracker(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, TrackingLink& link,
          const Clock* clock, double scene_share, std::pmr::memory_resource* memory = std::pmr::get_default_resource());
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
  // A frame that could not be read: counts as lost, breaks nothing.
  FrameResult SkipDamaged(std::uint32_t frame_index, TimePoint timestamp);

  TrackingState state() const { return state_; }
  // Frames for which the device had no feature set left. Any thread.
  std::uint64_t num_sets_refused() const { return num_sets_refused_.load(std::memory_order_relaxed); }

 private:
  // A feature of the current frame and the snapshot point that it shows.
  struct PointMatch {
    std::int32_t feature_idx = -1;
    std::int32_t point_idx = -1;
  };

  // A pose of an earlier frame that the mapper has answered with: from there the next good frame goes on.
  struct Start {
    bool is_found = false;  // in a stored map; else it is the second view of a new one
    MapId map_id = kNoId;
    SE3 cam_from_map;
    std::uint32_t frame_index = 0;
  };

  // What makes a pose, to return to when another one is no better.
  struct KeptPose {
    std::vector<PointMatch> matches;
    SE3 pose;
    Matrix6d information = Matrix6d::Zero();
    int num_expected = 0;
  };

  bool NeedsAllFeatures() const;
  void Measure(const Frame& frame, FrameResult* result);
  bool Extract(const Frame& frame);
  void HearMapper();
  void Hear(const MapFounded& founded);
  void Hear(const MapRefused& refused);
  void Hear(const FrameFound& found);
  void Hear(const FrameNotFound&) { is_asking_ = false; }
  void Hear(const Reframing& reframing);
  void TrackMap(FrameResult* result);
  void FindMap(FrameResult* result);
  bool TryFoundFrame(FrameResult* result);
  void AnswerWithoutMeasurement(FrameResult* result);
  SE3 Predict() const;
  void ContinueFrom(const Start& start);

  bool SearchAroundPrediction(const SE3& predicted);
  bool SearchLastFrame(const SE3& predicted, double radius_px);
  Stage LocalMapStage() const;
  bool FitLocalMap(double min_radius_px);
  bool SearchLocalMap(double min_radius_px);
  bool IsSuddenlyThin() const;
  void LookAround();
  void KeepPose(KeptPose* kept) const;
  void ReturnTo(const KeptPose& kept);
  bool SearchByBruteForce();
  GuidedQuery Displaced(GuidedQuery query, bool along_x) const;
  bool MeasureChance();
  double NumByChance() const;
  bool IsTrackedPoseEvident();
  bool HasEvidence(int min_inliers) const;
  bool RunGuided();
  bool GuidedMatch(std::span<const GuidedQuery> queries);
  bool OptimiseMatches();
  const NoiseModel& noise() const { return noise_meter_.model(); }
  void MeasureNoise();
  void WatchOverlay();
  void KeepInliers();
  void CountMatches();
  bool IsPlausibleMotion(const SE3& predicted) const;
  bool RecoverPose();
  void RecoverOrConfirm(bool* has_pose, FrameResult* result);
  bool IsQuestionedPoseConfirmed();
  bool BruteForceAgrees(double min_share) const;
  bool IsChosenPoseEvident();

  void ConsiderKeyframe(FrameResult* result);
  void ProposeKeyframe(FrameResult* result);
  void ProposeMap();
  void AskForPlace();
  void FillPose(FrameResult* result);
  int NearestKeyframe() const;
  void EndFrame();
  void EndUnmeasuredFrame();
  void SetLost();

  const LocalMap& local_map() const { return link_.snapshots.ReadSlot(); }

  const EngineConfig& config_;
  const CameraModel& camera_;
  VisionDevice& device_;
  TrackingLink& link_;
  FrameBudget budget_;
  LaneWait lane_;
  NoiseMeter noise_meter_;
  bool has_no_time_ = false;  // the frame is answered without a measurement
  bool pose_stands_ = false;  // it is tracked, whatever the device has not answered in time
  double motion_radius_px_;
  OverlayWatch overlay_;
  Initialiser initialiser_;
  AbsolutePoseRansac absolute_pose_;
  Rng rng_;

  std::atomic<std::uint64_t> num_sets_refused_{0};
  TrackingState state_ = TrackingState::kInitialising;
  bool had_map_ = false;  // a map was tracked before: relocalisation has something to look for
  MapId map_id_ = kNoId;
  std::uint64_t next_founding_id_ = 1;
  std::uint64_t awaited_founding_ = 0;  // 0: none
  bool is_asking_ = false;              // the mapper looks for a frame of ours and has not answered
  std::optional<Start> start_;
  // Replies heard.
  std::uint64_t num_found_heard_ = 0;
  std::uint64_t num_reframings_heard_ = 0;

  ProposedView current_;
  SE3 pose_;  // of the current frame, cam_from_map
  std::vector<PointMatch> matches_;
  std::vector<PointMatch> seeds_;  // found around the prediction, right or wrong
  KeptPose narrow_;                // before LookAround
  KeptPose questioned_;            // before RecoverOrConfirm
  std::vector<PointMatch> alike_;  // all that brute force found in the current frame

  bool has_last_ = false;
  FrameFeatures last_;
  bool owns_last_set_ = false;
  SE3 last_pose_;
  std::uint32_t last_pose_frame_ = 0;  // frame that last_pose_ belongs to
  std::uint32_t founding_frame_ = 0;   // second view of the awaited map
  std::vector<std::pair<std::int32_t, MapPointHandle>> last_matches_;
  SE3 velocity_;  // cam_now_from_cam_before, one frame
  bool has_velocity_ = false;

  TimePoint last_keyframe_time_;
  TimePoint last_timestamp_;
  SE3 last_keyframe_pose_;
  KeyframeId last_reference_ = kNoId;  // keyframe that the last pose was given relative to
  int num_predicted_ = 0;              // frames in a row
  bool current_is_proposed_ = false;   // its feature set has a new owner: mapper or initialiser

  // Workspaces.
  std::vector<GuidedQuery> queries_;
  std::vector<GuidedQuery> decoys_;
  std::vector<std::int32_t> query_points_;
  std::vector<Match> found_;
  std::int32_t num_found_ = 0;
  std::vector<std::uint8_t> allowed_;
  std::vector<std::uint8_t> is_matched_point_;
  std::vector<PoseObservation> observations_;
  std::vector<std::uint8_t> inliers_;
  std::vector<DescriptorRef> refs_;
  std::vector<Eigen::Vector2d> pixels_;
  std::vector<Eigen::Vector3d> bearings_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<double> tolerance_;
  int num_expected_ = 0;     // established points that should be visible from the pose
  int num_established_ = 0;  // established points among the matches
  bool has_chance_rate_ = false;
  double chance_rate_ = 0.0;                 // of the local map's points, those that are found where they are not
  double num_searched_ = 0.0;                // points of the local map in view
  Matrix6d information_ = Matrix6d::Zero();  // of pose_, from the last optimisation
  double median_depth_ = 1.0;
  std::vector<double> depths_;
  std::vector<OverlayWatch::Tracked> tracked_;
  SE3 overlay_pose_;  // of the frame that overlay_ keeps, in map overlay_map_
  MapId overlay_map_ = kNoId;
};

}  // namespace haustra
