// Similarity between two maps from pairs of points believed to be the same, with outliers: RANSAC on three pairs (Horn
// 1987, closed form), reprojection checked in both directions against each observation's sigma, MSAC score, local
// optimisation of every new best, adaptive stop. Refine the result with engine/optim/sim3_optimizer.h.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/sim3.h"
#include "engine/geometry/sim3_match.h"

namespace haustra {

// thread-bound(its owner), rt-safe after construction: all scratch is taken there.
class Sim3Ransac {
 public:
  struct Options {
    int max_iterations = 300;   // 1 and up
    double confidence = 0.999;  // (0, 1): stop when a better sample has become this unlikely
    int min_inliers = 12;       // 4 and up: with fewer, Run returns false
    double chi2_gate = 5.991;   // each direction on its own: 95 % of two degrees of freedom
  };
  struct Estimate {
    Sim3 b_from_a;
    int num_inliers = 0;
  };

  explicit Sim3Ransac(int max_matches);

  // views_a[k] = cam_from_a, views_b[k] = cam_from_b, both of the same camera model; every match names one of each.
  // False, with `estimate` untouched and inliers() all zero, when there are fewer than min_inliers or more than
  // max_matches, when a view index is out of range, or when no similarity gathers min_inliers. Cost: at most 0.2 us a
  // match and iteration; samples with outliers end early.
  bool Run(const CameraModel& camera, std::span<const Sim3Match> matches, std::span<const SE3> views_a,
           std::span<const SE3> views_b, const Options& options, Rng& rng, Estimate* estimate);

  // Of the last Run: one entry a match, 1 when both directions are within the gate.
  std::span<const std::uint8_t> inliers() const { return {inliers_.data(), static_cast<std::size_t>(num_matches_)}; }

 private:
  struct Input {
    const CameraModel* camera = nullptr;
    std::span<const Sim3Match> matches;
    std::span<const SE3> views_a, views_b;
    double inverse_gate = 0.0;
  };

  // Larger chi-square of the two directions over the gate, 1 at most.
  double MatchCost(const Input& input, const Sim3& b_from_a, const Sim3& a_from_b, int index) const;
  double Cost(const Input& input, const Sim3& b_from_a, double bound) const;
  // Closed form on the matches within the gate of `b_from_a`.
  bool AlignInliers(const Input& input, Sim3* b_from_a);

  int max_matches_;
  int num_matches_ = 0;
  std::vector<std::uint8_t> inliers_;
  std::vector<Eigen::Vector3d> points_in_a_, points_in_b_;  // scratch of AlignInliers
};

}  // namespace haustra
