// Relative pose of two calibrated views from matched bearings, with outliers: RANSAC on five points (five_point.h),
// MSAC score on the angular Sampson error, local optimisation on the manifold of essential matrices, descents from
// directions all around, decomposition by the points in front of both cameras, triangulation. The paper uses eight
// points (Longuet-Higgins 1981); five need fewer trials and, unlike eight, still work when the points lie on a plane or
// a quadric such as a tube around the camera.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"

namespace haustra {

// Of a motion, |translation| > 0: sum of 1 - min(error^2 / tolerance^2, 1) over the matches, as TwoViewRansac counts
// it. Spans of one length. reentrant, rt-safe.
double EpipolarScore(const SE3& b_from_a, std::span<const Eigen::Vector3d> bearings_a,
                     std::span<const Eigen::Vector3d> bearings_b, std::span<const double> tolerance_rad);

// thread-bound(its owner), rt-safe after construction: all scratch is taken there.
class TwoViewRansac {
 public:
  struct Options {
    int max_iterations = 400;          // 1 and up
    double confidence = 0.999;         // (0, 1): stop when a better sample has become this unlikely
    int min_inliers = 20;              // 8 and up: with fewer, Run returns false
    double max_runner_up_share = 0.7;  // (0, 1): of the four decompositions, points in front in the second best / best
    // 0 and up, units of score: by how much any other motion must fit worse. Near a plane, and where the scope has
    // hardly turned around anything, a relief and its mirror image fit alike, and the choice is chance. 0: none is
    // looked for.
    double min_rival_lead = 3.0;
    double min_moving_share =
        0.25;  // [0, 1]: inliers whose parallax is beyond twice their tolerance. Below, the motion
               //   may as well be a rotation, and translation and depth are noise
    // Asked before every trial and before the end; once it is true Run returns false. Empty: never. One that captures a
    // pointer allocates nothing.
    std::function<bool()> should_stop;
  };
  struct Estimate {
    SE3 b_from_a;  // |translation| = 1
    int num_inliers = 0;
    double score = 0.0;  // sum of 1 - min(error^2 / tolerance^2, 1): inliers, each counted by how well it fits
    // Standard deviation of the translation's direction along its worst axis, to first order, when the noise of the
    // inliers is what the tolerances say (1.96 sigma). Infinite when they leave the direction open.
    double direction_sigma_rad = 0.0;
    // Noise of all matches over that noise, by the median of their residuals: 1 when the motion explains 95 % of them,
    // 2.9 when it explains half.
    double noise_ratio = 1.0;
  };

  explicit TwoViewRansac(int max_matches);
  // Taken at construction.
  static constexpr std::size_t kBytesPerMatch = 3 * sizeof(double) + sizeof(std::uint8_t) + sizeof(Eigen::Vector3d);

  // bearings_a[i], bearings_b[i]  unit vectors of one point in the two cameras
  // tolerance_rad[i]              smallest joint turn of both bearings (root of the sum of squares) that would make
  // them
  //                               meet, up to which the match is an inlier; chi-square of one degree of freedom when
  //                               both have the same sigma (1.96 sigma for 95 %)
  // False, with `estimate` untouched and inliers() all zero, when the spans differ in length, hold fewer than
  // min_inliers or more than max_matches, when too few matches agree on a motion, when they agree with a pure
  // rotation, when two decompositions are about equally good, or when two motions are. Cost: about 20 us and at most 15
  // ns a match for each iteration and root, and 10 to 25 ns a match for each of the descents' 170 steps.
  bool Run(std::span<const Eigen::Vector3d> bearings_a, std::span<const Eigen::Vector3d> bearings_b,
           std::span<const double> tolerance_rad, const Options& options, Rng& rng, Estimate* estimate);

  // After Run, whatever it returned: descends from a motion to the nearest minimum of the same matches, and returns its
  // score, which compares with Estimate::score. |translation| = 1 afterwards; before, it may be anything but 0.
  double Descend(SE3* b_from_a) const;

  // The last Run found a motion, and another one that fits nearly as well: it returned false.
  bool has_rival() const { return has_rival_; }
  // The last Run returned false because hardly anything moves: so many matches agree with a motion, and all but
  // min_moving_share of them with its rotation alone. 0 when it was for another reason, or true. Means nothing when it
  // was stopped.
  int num_still() const { return num_still_; }
  // Of the last Run, one entry a match: 1 for an inlier, which has a point in front of both cameras.
  std::span<const std::uint8_t> inliers() const { return {inliers_.data(), static_cast<std::size_t>(num_matches_)}; }
  // Triangulated points in camera a, in units of the baseline, and the angles between their rays. Only the entries of
  // inliers mean anything.
  std::span<const Eigen::Vector3d> points_in_a() const {
    return {points_in_a_.data(), static_cast<std::size_t>(num_matches_)};
  }
  std::span<const double> parallax_rad() const {
    return {parallax_rad_.data(), static_cast<std::size_t>(num_matches_)};
  }

 private:
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;

  double Cost(const Eigen::Matrix3d& essential, double bound) const;
  // Normal equations of the inliers' Sampson angles in units of their tolerances. Parameters: rotation (left
  // perturbation) and the direction of the translation along `u` and `v`. Returns how many inliers there are.
  int Linearise(const SE3& b_from_a, const Eigen::Vector3d& u, const Eigen::Vector3d& v, Matrix5d* hessian,
                Vector5d* gradient) const;
  void Refine(int iterations, SE3* b_from_a) const;
  double DirectionSigma(const SE3& b_from_a) const;
  double NoiseRatio(const SE3& b_from_a);
  // Of the four poses behind the essential matrix of `b_from_a` the one with most points in front, and how many.
  bool ChooseDecomposition(const Options& options, SE3* b_from_a, int* num_in_front) const;
  // The second motion that the plane through the triangulated points would allow; false when there is none.
  bool PlanarTwin(const SE3& b_from_a, SE3* twin) const;
  // Descends from the twin and from directions all around: chance does not decide which minimum is found. Replaces the
  // motion by the lowest one; sets has_rival_ where another one costs hardly more. False when it was stopped.
  bool LookForRivals(const Options& options, SE3* b_from_a, double* cost, int* num_in_front);
  int Triangulate(const SE3& b_from_a);
  int NumStill(const SE3& b_from_a, const Options& options) const;

  int max_matches_;
  int num_matches_ = 0;
  bool has_rival_ = false;
  int num_still_ = 0;
  std::span<const Eigen::Vector3d> bearings_a_;
  std::span<const Eigen::Vector3d> bearings_b_;
  std::vector<double> inverse_tolerance2_;
  std::vector<std::uint8_t> inliers_;
  std::vector<Eigen::Vector3d> points_in_a_;
  std::vector<double> parallax_rad_;
  std::vector<double> residual2_;
};

}  // namespace haustra
