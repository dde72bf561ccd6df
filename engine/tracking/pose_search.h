// The pose of the current frame in the local map by guided search, from a guess of it: the last frame's points first,
// then all points that should be in sight, then a pose fitted to what was found. Measures how many of them would be
// found by chance. What the device does not answer by the frame's deadline counts as not found; has_no_time() tells.
// thread-bound(tracking); rt-safe after construction: no allocation, no wait but for the vision device.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/atlas/local_map.h"
#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/noise_model.h"
#include "engine/optim/pose_from_matches.h"
#include "engine/scheduler/frame_budget.h"
#include "engine/scheduler/lane_wait.h"
#include "engine/tracking/keyframe_proposal.h"
#include "engine/tracking/map_sight.h"
#include "engine/tracking/overlay_watch.h"
#include "hal/core/mailbox.h"
#include "hal/vision_device.h"

namespace haustra {

// A pose from fewer points than this is not worth a search of the local map.
inline constexpr int kMinSeedInliers = 8;

// A feature of the current frame and the point of the local map that it shows.
struct PointMatch {
  std::int32_t feature_idx = -1;
  std::int32_t point_idx = -1;
};

// A pose of the current frame and what speaks for it.
struct PoseEstimate {
  std::vector<PointMatch> matches;
  SE3 cam_from_map;
  Matrix6d information = Matrix6d::Zero();  // of the pose, from the last optimisation
  int num_expected = 0;                     // established points that should be visible from the pose
  int num_expected_seasoned = 0;            // of these, those established when the map was last seen well
  int num_established = 0;                  // of the matches
  int num_seasoned = 0;                     // of these likewise
  double median_depth = 1.0;                // of the matches, map units
};

// The last frame that was measured, and the points that it showed.
struct LastFrame {
  explicit LastFrame(int max_features, std::pmr::memory_resource* memory);

  FrameFeatures features;
  std::vector<std::pair<std::int32_t, MapPointHandle>> matches;  // feature and point
};

class PoseSearch {
 public:
  // All of them outlive it and are those of the tracker; `frame` is the current one.
  struct Parts {
    const EngineConfig& config;
    const CameraModel& camera;
    const SceneRegion& scene;
    LaneWait& lane;
    FrameBudget& budget;
    const OverlayWatch& overlay;
    const NoiseModel& noise;
    const MapSight& sight;
    const LatestMailbox<LocalMap>& snapshots;
    const ProposedView& frame;
    const LastFrame& last;
  };
  explicit PoseSearch(const Parts& parts);
  // Of its workspaces, on the heap.
  static std::size_t BytesFor(int max_features, int max_points);

  // A new frame: nothing is found yet.
  void Begin();
  // The frame's deadline has ended the search, or would.
  bool has_no_time() const { return has_given_up_ || parts_.lane.has_pending(); }

  // Near the prediction first, then further away, then around the last pose, while there is time. What is found are
  // the seeds.
  bool SearchAroundPrediction(const SE3& predicted, const SE3& last_pose);
  // Without points of the last frame: the local map itself, in wide windows.
  bool SearchWithoutLastFrame(const SE3& predicted);
  // Adds what else of the local map is found around the pose, and fits the pose to all of it.
  bool FitLocalMap(double min_radius_px);
  bool SearchLocalMap(double min_radius_px);
  // Widens the window once; the better pose stays.
  void LookAround();
  // Far less of the map agrees with the pose than with the last one.
  bool IsSuddenlyThin() const;

  // Fits the pose to the matches, and drops those of young points that the established ones deny. False: too few agree,
  // and the pose may be anything.
  bool FitMatches();
  // The pose that most matches agree with, whatever the estimate was. False: there is none.
  bool SampleMatches(Rng& rng);
  // Leaves the matches that agreed with the pose when it was fitted.
  void KeepInliers();
  // How many of the matches are of established and of seasoned points, and how far away their points are.
  void CountMatches();

  // How many of the local map's points would be found by chance. False: the device has not answered.
  bool MeasureChance();
  double NumByChance() const { return chance_rate_ * num_searched_; }
  // A pose is known when more of the map agrees with it than chance would give, by a margin that chance does not reach,
  // and when so many detected features do: what is followed slides together with what comes before the wall.
  bool HasEvidence(int min_inliers, int min_detected) const;
  // `is_confirmed`: so was the pose before, of which this one is a small step (TrackingConfig::min_detected).
  bool IsTrackedPoseEvident(bool is_confirmed);
  // Step by step the map may have gone over to what came before the wall, which agrees with itself for as long as it
  // stays. False: the map is not young, and hardly any of the points is seen that were established when it was last
  // seen well, though they should be (TrackingConfig::min_seasoned).
  bool HasSeasonedWitnesses() const;
  // For a pose without a prediction. Bubbles and films move by themselves: what was triangulated on them a moment ago
  // agrees with them, and not with the wall. False: established points should be seen, and hardly any is that was
  // established when the map was last seen well.
  bool HasEstablishedWitnesses() const;

  // The point is seen where the pose puts it: 95 % of two degrees of freedom of the feature's noise.
  bool AgreesWith(const SE3& cam_from_map, const PointMatch& match) const;

  // The keyframe of the window that shares most points with the frame.
  int NearestKeyframe() const;

  PoseEstimate& estimate() { return estimate_; }
  const PoseEstimate& estimate() const { return estimate_; }
  const std::vector<PointMatch>& seeds() const { return seeds_; }
  const LocalMap& local_map() const { return parts_.snapshots.ReadSlot(); }
  double motion_radius_px() const { return motion_radius_px_; }

 private:
  bool SearchLastFrame(const SE3& predicted, double radius_px);
  Stage LocalMapStage() const;
  bool is_established(const PointMatch& match) const {
    return local_map().is_established(local_map().points[match.point_idx]);
  }
  GuidedQuery Displaced(GuidedQuery query, bool along_x) const;
  void ListMatch(const PointMatch& match);
  void LetEstablishedLead();
  bool RunGuided();
  bool GuidedMatch(std::span<const GuidedQuery> queries);

  const Parts parts_;
  const double motion_radius_px_;
  PoseFromMatches pose_from_matches_;
  PoseEstimate estimate_;
  PoseEstimate narrow_;            // before LookAround
  std::vector<PointMatch> seeds_;  // found around the prediction, right or wrong, but what FitMatches drops
  bool has_given_up_ = false;
  bool has_chance_rate_ = false;
  double chance_rate_ = 0.0;   // of the local map's points, those that are found where they are not
  double num_searched_ = 0.0;  // points of the local map in view

  // Workspaces.
  std::vector<GuidedQuery> queries_;
  std::vector<GuidedQuery> decoys_;
  std::vector<std::int32_t> query_points_;
  std::vector<Match> found_;
  std::int32_t num_found_ = 0;
  std::vector<std::uint8_t> allowed_;
  std::vector<std::uint8_t> is_matched_point_;
  std::vector<Eigen::Vector3d> bearings_;
  std::vector<double> depths_;
};

}  // namespace haustra
