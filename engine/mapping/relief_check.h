// A young map may be the mirror of what is seen: near is far, and a step across the view is a turn (Necker's reversal,
// decisions/2026-11-26-a-young-map-is-turned-over.md). Its founding could not tell, and all that is searched where its
// poses say agrees with it. Wider pairs of keyframes, matched by appearance, can tell. Where they contradict the map,
// all of it is built anew from the best of them, and the better of the two stays. thread-bound(mapping).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/absolute_pose.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/two_view.h"
#include "engine/mapping/view_pair.h"
#include "engine/noise_model.h"
#include "engine/optim/schur_bundle_adjustment.h"

namespace haustra {

class ReliefCheck {
 public:
  // Everything named outlives it; the adjuster may have other users between calls.
  ReliefCheck(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device,
              SchurBundleAdjuster& adjuster);

  // Judges the map of a keyframe by its pairs with the first mapping.link_neighbours of the list. True: the map was
  // built anew. The keyframe stands where it stood, at the same scale; the others and the points have moved, and points
  // and observations that do not fit have gone. Cost: a matching and a RANSAC a neighbour, rarely two bundles of all.
  bool Correct(KeyframeHandle handle, std::span<const Covisible> neighbours, Atlas* atlas);

 private:
  // A point of the map, and what is known of it in the other relief.
  struct Place {
    MapPointHandle point;
    Eigen::Vector3d position;  // in the map
    bool is_known = false;
  };

  bool IsContradicted(KeyframeHandle handle, std::span<const Covisible> neighbours, const Atlas& atlas);
  void Begin(KeyframeHandle handle, const Atlas& atlas);
  void PlacePair(const Atlas& atlas);
  bool PlaceKeyframes(const Atlas& atlas);
  bool PlaceNext(const Atlas& atlas);
  void PlacePoints(const Atlas& atlas);
  bool Triangulate(const MapPoint& point, const Atlas& atlas, Eigen::Vector3d* position) const;
  // All keyframes and the points that are known; the newest keyframe is held.
  void Solve(const Atlas& atlas, BundleProblem* problem);
  // Of the matches of the pairs that told, by the poses of a problem.
  double Unexplained(const BundleProblem& problem, const Atlas& atlas);
  void Fill(const Atlas& atlas, BundleProblem* problem) const;
  void WriteBack(Atlas* atlas) const;

  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  SchurBundleAdjuster& adjuster_;
  ViewPair pair_;
  TwoViewRansac ransac_;
  AbsolutePoseRansac pose_ransac_;
  Rng rng_;

  std::vector<KeyframeHandle> told_;  // that `newest_` makes pairs with which tell a motion
  double unexplained_by_own_ = 0.0;   // of the matches of these pairs, each by its own motion
  // The pair that contradicts most: a point for each feature of `newest_` that it explains, in units of its baseline.
  KeyframeHandle newest_;
  KeyframeHandle other_;
  SE3 other_from_newest_;
  std::vector<Match> start_matches_;
  std::vector<Eigen::Vector3d> start_points_;

  std::vector<KeyframeHandle> keyframes_;
  std::vector<SE3> poses_;               // of each, in the other relief
  std::vector<std::uint8_t> is_placed_;  // likewise
  std::vector<std::int32_t> slots_;      // by keyframe slot: index in keyframes_, -1
  std::vector<Place> places_;
  std::vector<std::int32_t> place_of_;  // by point slot: index in places_, -1
  BundleProblem now_;                   // the map as it is
  BundleProblem turned_;                // in the other relief
  // Workspaces.
  std::vector<Eigen::Vector3d> bearings_;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<double> tolerance_rad_;
  std::vector<double> ratios_;
};

}  // namespace haustra
