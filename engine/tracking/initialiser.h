// Finds two views of which a new map can be made: brute-force matches inside a disparity window, epipolar geometry by
// RANSAC, and then every check of the paper (Section III-D): matches, inliers, parallax, spread over the image.
// thread-bound(tracking), rt-safe after construction. Owns the feature set of its reference frame.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/two_view.h"
#include "engine/scheduler/frame_budget.h"
#include "engine/scheduler/lane_wait.h"
#include "engine/tracking/frame_result.h"
#include "engine/tracking/keyframe_proposal.h"
#include "engine/tracking/overlay_watch.h"
#include "hal/vision_device.h"

namespace haustra {

class Initialiser {
 public:
  // `lane`, `overlay` and `scene` outlive this; what stands still in front of the scene founds nothing. What goes into
  // proposals is taken from `memory`, which must be that of the proposals.
  Initialiser(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, LaneWait& lane,
              OverlayWatch& overlay, const SceneRegion& scene,
              std::pmr::memory_resource* memory = std::pmr::get_default_resource());
  // What construction takes from an arena.
  static std::size_t BytesFor(int max_features, int max_between);

  // Forgets all views.
  void Reset();
  bool has_reference() const { return has_reference_; }

  // Keeps the view, with its feature set: as the reference when there is none, else as one of those between the
  // reference and the view that will found the map. When there is no room every second of them goes, so that a slow
  // scope finds its baseline, however long that takes.
  void Keep(const ProposedView& view);
  // After Try, when the reference has little in common with what is seen now: the middle one of the kept views is the
  // next one. A reference that shares less and less with the present still leaves half of the baseline behind.
  void RenewReference();

  // Compares the view with one that was kept, as long as the frame's time allows (FrameBudget::ShouldStopInitialising).
  // It is the reference at first; while no motion is certain, at each next call the one half as old, until parallax is
  // wanting; then the reference again. What was seen in a blurred pan, or has half gone behind an instrument, founds
  // nothing, and a view after it does.
  // kNoTime: it was stopped, and all is as before. kMapProposed: MoveInto() gives what founds the map.
  TrackingReason Try(const ProposedView& view, const FrameBudget& budget);
  // After Try: the reference has little in common with what is seen now, or no motion explains it any more.
  bool is_worn_out() const { return is_worn_out_; }

  // What MoveInto would give.
  std::span<const FoundingPair> pairs() const { return {pairs_.data(), static_cast<std::size_t>(num_pairs_)}; }

  int num_matches() const { return num_matches_; }
  int num_inliers() const { return num_inliers_; }

  // Moves everything that founds the map into the proposal, with the feature sets of reference and kept views, and
  // forgets the reference. The proposal's own view is the caller's.
  void MoveInto(KeyframeProposal* proposal);

 private:
  void ThinOut();
  // The view with so many older ones kept: the reference is 0.
  const ProposedView& EarlierView(std::size_t num_skipped) const;
  // The kept view is the reference from now on; what is older is forgotten.
  void BeginWith(std::size_t kept);
  bool HasWornOut(TrackingReason reason, TimePoint time);
  void ChooseNext(TrackingReason reason, TimePoint time);
  TrackingReason Compare(const ProposedView& earlier, const ProposedView& view, const FrameBudget& budget);

  const EngineConfig& config_;
  const CameraModel& camera_;
  VisionDevice& device_;
  LaneWait& lane_;
  OverlayWatch& overlay_;
  const DisparityWindow window_;
  const SceneRegion& scene_;

  TwoViewRansac ransac_;
  Rng rng_;
  bool has_reference_ = false;
  std::size_t num_skipped_ = 0;  // before the view to compare with next
  bool is_worn_out_ = false;
  bool is_unexplained_ = false;  // the last view
  TimePoint unexplained_since_;
  ProposedView reference_;
  SE3 cam_from_reference_;
  int num_matches_ = 0;
  int num_inliers_ = 0;
  std::int32_t num_pairs_ = 0;
  std::pmr::vector<FoundingPair> pairs_;
  std::size_t num_between_ = 0;
  std::pmr::vector<ProposedView> between_;
  std::vector<Match> matches_;
  std::vector<Eigen::Vector3d> bearings_a_;
  std::vector<Eigen::Vector3d> bearings_b_;
  std::vector<double> tolerance_;
  std::vector<double> parallax_;
  std::vector<double> residual_;
  std::vector<Eigen::Vector2d> pixels_;
};

}  // namespace haustra
