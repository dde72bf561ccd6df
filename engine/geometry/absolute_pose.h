// Camera pose from bearings and the map points that they may show, with outliers: RANSAC on three points (p3p.h), MSAC
// score, local optimisation of every new best (Lebeda, Matas, Chum 2012, "Fixing the locally optimized RANSAC") and an
// adaptive stop. The paper solves from six points (section 8 of the system page); three need far fewer trials.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"

namespace haustra {

// thread-bound(its owner), rt-safe after construction: all scratch is taken there.
class AbsolutePoseRansac {
 public:
  struct Options {
    int max_iterations = 300;   // 1 and up
    double confidence = 0.999;  // (0, 1): stop when a better sample has become this unlikely
    int min_inliers = 10;       // 4 and up: with fewer, Run returns false
  };
  struct Estimate {
    SE3 cam_from_world;
    int num_inliers = 0;
  };

  explicit AbsolutePoseRansac(int max_matches);
  // Taken at construction.
  static constexpr std::size_t kBytesPerMatch = sizeof(double) + sizeof(std::uint8_t);

  // bearings[i]         unit vector in the camera
  // points_in_world[i]  the point it may show, any unit
  // tolerance_rad[i]    angle between them up to which the match is an inlier (2.45 sigma for 95 % of true matches)
  // False, with `estimate` untouched and inliers() all zero, when the spans differ in length, hold fewer than
  // min_inliers or more than max_matches, or when no pose gathers min_inliers. Cost: about 10 ns a match and iteration
  // at most; samples with outliers end early.
  bool Run(std::span<const Eigen::Vector3d> bearings, std::span<const Eigen::Vector3d> points_in_world,
           std::span<const double> tolerance_rad, const Options& options, Rng& rng, Estimate* estimate);

  // Of the last Run: one entry a match, 1 for an inlier.
  std::span<const std::uint8_t> inliers() const { return {inliers_.data(), static_cast<std::size_t>(num_matches_)}; }

 private:
  // Sum of min(error^2 / tolerance^2, 1); stops counting beyond `bound`.
  double Cost(const SE3& cam_from_world, double bound) const;
  // Gauss-Newton on the matches inside the tolerance, chosen anew at every step.
  void Refine(int iterations, SE3* cam_from_world) const;

  int max_matches_;
  int num_matches_ = 0;
  std::span<const Eigen::Vector3d> bearings_;
  std::span<const Eigen::Vector3d> points_in_world_;
  std::vector<double> inverse_tolerance2_;
  std::vector<std::uint8_t> inliers_;
};

}  // namespace haustra
