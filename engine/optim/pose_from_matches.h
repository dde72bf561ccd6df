// The pose of one camera from features and the map points that they may show: RANSAC on three points where nothing is
// known of it (geometry/absolute_pose.h), a robust fit where something is (pose_optimizer.h). Both gate by chi-square
// of each observation's sigma, 95 % of two degrees of freedom.
// thread-bound(its owner); rt-safe after construction as long as no more than max_matches are added.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/absolute_pose.h"
#include "engine/geometry/rng.h"
#include "engine/optim/pose_optimizer.h"

namespace haustra {

class PoseFromMatches {
 public:
  PoseFromMatches(const CameraModel& camera, int max_matches);
  // Taken at construction.
  static constexpr std::size_t kBytesPerMatch = AbsolutePoseRansac::kBytesPerMatch + sizeof(PoseObservation) +
                                                sizeof(std::uint8_t) + sizeof(Eigen::Vector3d) + sizeof(double);

  // The matches, one after another; inliers() are in their order.
  void Clear() { observations_.clear(); }
  // point_in_map: map units. sigma_px: of the feature, > 0.
  void Add(const Eigen::Vector3d& point_in_map, const Eigen::Vector2d& pixel, double sigma_px) {
    observations_.push_back({point_in_map, pixel, sigma_px});
  }
  std::span<const PoseObservation> matches() const { return observations_; }

  // Without a guess. bearings[i] is the unit vector of match i, zero for one that agrees with nothing. False, with
  // `estimate` untouched: no pose gathers options.min_inliers.
  bool Sample(std::span<const Eigen::Vector3d> bearings, const AbsolutePoseRansac::Options& options, Rng& rng,
              AbsolutePoseRansac::Estimate* estimate);
  // From a guess, to all matches. False when fewer than min_inliers agree with the fit; when there is no fit at all
  // `result` is untouched, too, and no match is an inlier.
  bool Fit(const SE3& guess, int min_inliers, PoseOptimizerResult* result);

  // Of the last Sample or Fit: one entry a match, 1 where it agrees.
  std::span<const std::uint8_t> inliers() const { return {inliers_.data(), observations_.size()}; }

  // Leaves those elements of a list with one entry a match that agreed.
  template <typename T>
  void KeepInliers(std::vector<T>* list) const {
    std::size_t num = 0;
    for (std::size_t i = 0; i < list->size(); ++i) {
      if (inliers_[i] != 0) (*list)[num++] = (*list)[i];
    }
    list->resize(num);
  }

 private:
  const CameraModel& camera_;
  AbsolutePoseRansac ransac_;
  std::vector<PoseObservation> observations_;
  std::vector<std::uint8_t> inliers_;
  // Workspaces of Sample.
  std::vector<Eigen::Vector3d> points_;
  std::vector<double> tolerance_;
};

}  // namespace haustra
