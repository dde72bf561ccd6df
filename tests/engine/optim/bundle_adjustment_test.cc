// Every test runs on each implementation of the interface; truth is the geometry the scene was made from.
#include "engine/optim/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "engine/optim/benchmarks/synthetic_bundle.h"
#include "engine/optim/schur_bundle_adjustment.h"

namespace haustra {
namespace {

using Adjuster = Result<BundleSummary> (*)(const CameraModel&, const BundleOptions&, BundleProblem*);

struct Implementation {
  const char* name;
  Adjuster adjust;
};

class BundleAdjustment : public ::testing::TestWithParam<Implementation> {
 protected:
  Result<BundleSummary> Adjust(const CameraModel& camera, const BundleOptions& options, BundleProblem* problem) const {
    return GetParam().adjust(camera, options, problem);
  }
};

INSTANTIATE_TEST_SUITE_P(Implementations, BundleAdjustment,
                         ::testing::Values(Implementation{"ceres", &AdjustBundle},
                                           Implementation{"schur", &AdjustBundleSchur}),
                         [](const auto& instance) { return std::string(instance.param.name); });

SyntheticBundleOptions SmallWindow() {
  SyntheticBundleOptions options;
  options.num_poses = 7;
  options.num_points = 220;
  options.mean_track_length = 4.0;
  return options;
}

double MaxPointError(const BundleProblem& a, const BundleProblem& b) {
  double error = 0.0;
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    error = std::max(error, (a.points[i].position - b.points[i].position).norm());
  }
  return error;
}

double MaxCentreError(const BundleProblem& a, const BundleProblem& b) {
  double error = 0.0;
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    error = std::max(
        error,
        (a.poses[i].cam_from_world.InverseTranslation() - b.poses[i].cam_from_world.InverseTranslation()).norm());
  }
  return error;
}

double MaxRotationError(const BundleProblem& a, const BundleProblem& b) {
  double error = 0.0;
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    error = std::max(error, RotationAngle(a.poses[i].cam_from_world.rotation, b.poses[i].cam_from_world.rotation));
  }
  return error;
}

double RmsCentreError(const BundleProblem& a, const BundleProblem& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    sum +=
        (a.poses[i].cam_from_world.InverseTranslation() - b.poses[i].cam_from_world.InverseTranslation()).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(a.poses.size()));
}

bool IsSamePose(const BundlePose& a, const BundlePose& b) {
  return a.cam_from_world.rotation.coeffs() == b.cam_from_world.rotation.coeffs() &&
         a.cam_from_world.translation == b.cam_from_world.translation;
}

bool IsSameGeometry(const BundleProblem& a, const BundleProblem& b) {
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    if (!IsSamePose(a.poses[i], b.poses[i])) return false;
  }
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    if (a.points[i].position != b.points[i].position) return false;
  }
  return true;
}

// A clock that moves on by one millisecond at each look, and can set a flag at a given look.
class SteppingClock : public Clock {
 public:
  TimePoint Now() const override {
    ++num_looks_;
    if (num_looks_ == cancel_at_look) cancel = true;
    return TimePoint(std::chrono::milliseconds(num_looks_));
  }
  int cancel_at_look = 0;
  mutable std::atomic<bool> cancel = false;

 private:
  mutable int num_looks_ = 0;
};

TEST_P(BundleAdjustment, NoiseFreePixelsGiveTheTruth) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.pixel_noise_sigmas = 0.0;
  const SyntheticBundle bundle = MakeSyntheticBundle(scene);
  BundleProblem problem = bundle.start;
  BundleOptions options;
  options.max_iterations = 40;

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok()) << summary.status().ToString();
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_EQ(summary->num_outliers, 0);
  EXPECT_GT(summary->initial_cost, 1e3);
  EXPECT_LT(summary->final_cost, 1e-6);
  EXPECT_LT(MaxPointError(problem, bundle.truth), 1e-3);
  EXPECT_LT(MaxCentreError(problem, bundle.truth), 1e-5);
  EXPECT_LT(MaxRotationError(problem, bundle.truth), 1e-5);
}

TEST_P(BundleAdjustment, PixelNoiseGivesTheExpectedChiSquare) {
  const SyntheticBundle bundle =
      MakeSyntheticBundle({.num_poses = 12, .num_points = 800, .mean_track_length = 6.0, .pose_noise_rad = 0.05});
  BundleProblem problem = bundle.start;
  BundleOptions options;
  options.max_iterations = 30;
  options.chi2_gate = 1e6;  // plain least squares: the sum of squares is chi-square distributed

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  const double freedom = 2.0 * problem.observations.size() - 3.0 * problem.points.size() - 6.0 * 10;
  const double chi2 = 2.0 * summary->final_cost;
  EXPECT_NEAR(chi2, freedom, 5.0 * std::sqrt(2.0 * freedom));
  EXPECT_LT(RmsCentreError(problem, bundle.truth), 0.3 * RmsCentreError(bundle.start, bundle.truth));
}

TEST_P(BundleAdjustment, GrossErrorsAreFlaggedAndDoNoHarm) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.num_poses = 12;
  scene.mean_track_length = 8.0;
  scene.pixel_noise_sigmas = 0.1;
  scene.outlier_share = 0.05;
  SyntheticBundle bundle = MakeSyntheticBundle(scene);
  // Both ends are held, so that the scale does not hang on the short baseline of the first two cameras alone.
  bundle.start.poses.back() = {.cam_from_world = bundle.truth.poses.back().cam_from_world, .is_fixed = true};
  BundleProblem problem = bundle.start;
  BundleOptions options;
  options.max_iterations = 30;

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  int num_made = 0, num_missed = 0, num_false = 0;
  // A point with few observations, one of them wrong, cannot tell which.
  std::vector<int> num_good(problem.points.size(), 0);
  for (const BundleObservation& observation : bundle.truth.observations) {
    num_good[observation.point_idx] += observation.is_outlier ? 0 : 1;
  }
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (num_good[problem.observations[i].point_idx] < 4) continue;
    const bool is_made = bundle.truth.observations[i].is_outlier;
    num_made += is_made;
    num_missed += is_made && !problem.observations[i].is_outlier;
    num_false += !is_made && problem.observations[i].is_outlier;
  }
  EXPECT_GT(num_made, 20);
  EXPECT_EQ(num_missed, 0);
  EXPECT_LE(num_false, num_made / 10);
  EXPECT_LT(MaxCentreError(problem, bundle.truth), 0.01);
}

TEST_P(BundleAdjustment, RejectionMidwayIsMoreAccurateThanHuberAlone) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.pixel_noise_sigmas = 0.3;
  scene.outlier_share = 0.15;
  const SyntheticBundle bundle = MakeSyntheticBundle(scene);
  BundleOptions options;
  options.max_iterations = 40;
  BundleProblem with = bundle.start;
  ASSERT_TRUE(Adjust(bundle.camera, options, &with).ok());
  options.reject_outliers_midway = false;
  BundleProblem without = bundle.start;
  ASSERT_TRUE(Adjust(bundle.camera, options, &without).ok());

  EXPECT_LT(RmsCentreError(with, bundle.truth), RmsCentreError(without, bundle.truth));
}

TEST_P(BundleAdjustment, FixedPosesAndPointsStayToTheBit) {
  SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  bundle.start.poses[4].is_fixed = true;
  bundle.start.points[3].is_fixed = true;
  bundle.start.points[70].is_fixed = true;
  BundleProblem problem = bundle.start;

  ASSERT_TRUE(Adjust(bundle.camera, BundleOptions(), &problem).ok());

  for (const std::size_t i : {0, 1, 4}) EXPECT_TRUE(IsSamePose(problem.poses[i], bundle.start.poses[i])) << i;
  EXPECT_FALSE(IsSamePose(problem.poses[3], bundle.start.poses[3]));
  EXPECT_EQ(problem.points[3].position, bundle.start.points[3].position);
  EXPECT_EQ(problem.points[70].position, bundle.start.points[70].position);
  EXPECT_NE(problem.points[4].position, bundle.start.points[4].position);
}

TEST_P(BundleAdjustment, WhatIsNotObservedStaysToTheBit) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  BundleProblem problem = bundle.start;
  // Many, because normalising a quaternion again changes the last bit of only some.
  const std::size_t num_observed = problem.poses.size();
  for (int i = 0; i < 50; ++i)
    problem.poses.push_back({.cam_from_world = SE3(ExpSO3({0.1 * i, 1, -0.03 * i}), {1, 2, 3})});
  problem.points.push_back({.position = {4, 5, 6}});
  const BundleProblem before = problem;

  const Result<BundleSummary> summary = Adjust(bundle.camera, BundleOptions(), &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kConverged);
  for (std::size_t i = num_observed; i < problem.poses.size(); ++i) {
    EXPECT_TRUE(IsSamePose(problem.poses[i], before.poses[i])) << i;
  }
  EXPECT_EQ(problem.points.back().position, Eigen::Vector3d(4, 5, 6));
}

TEST_P(BundleAdjustment, WithoutFixedPoseTheFirstIsHeldAndTheMedianDistanceOfPointsKept) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.num_fixed_poses = 0;
  const SyntheticBundle bundle = MakeSyntheticBundle(scene);
  BundleProblem problem = bundle.start;

  const Result<BundleSummary> summary = Adjust(bundle.camera, BundleOptions(), &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_TRUE(IsSamePose(problem.poses[0], bundle.start.poses[0]));
  std::vector<double> shrinks;
  for (const BundleObservation& observation : problem.observations) {
    const auto distance = [&](const BundleProblem& p) {
      return (p.poses[observation.pose_idx].cam_from_world * p.points[observation.point_idx].position).norm();
    };
    shrinks.push_back(distance(bundle.start) / distance(problem));
  }
  const auto middle = shrinks.begin() + static_cast<std::ptrdiff_t>(shrinks.size() / 2);
  std::nth_element(shrinks.begin(), middle, shrinks.end());
  EXPECT_NEAR(*middle, 1.0, 1e-9);
  EXPECT_LT(summary->final_cost, 0.2 * summary->initial_cost);
}

// A young map whose newest camera is back where the oldest stands, as they come from a scope that hovers: the distance
// of these two says nothing about the unit. 0.1 % of noise on where the cameras start must not change it.
TEST_P(BundleAdjustment, UnitOfAMapDoesNotHangOnTwoCameras) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Rng rng(seed);
    const CameraModel camera = SyntheticEndoscope();
    constexpr int kPoses = 8;
    BundleProblem truth;
    for (int i = 0; i < kPoses; ++i) {
      // The newest first, the oldest last, as the mapper hands them over.
      const double turn = std::numbers::pi * i / (kPoses - 1);
      const Eigen::Vector3d centre(0.2 * std::sin(turn), 0.1 * std::sin(2 * turn), i == 0 ? 0.004 : 0.0);
      truth.poses.push_back({.cam_from_world = SE3(Eigen::Quaterniond::Identity(), -centre), .is_fixed = i == 7});
    }
    while (truth.points.size() < 300) {
      const Eigen::Vector3d direction(rng.Uniform(-0.6, 0.6), rng.Uniform(-0.6, 0.6), 1.0);
      truth.points.push_back({.position = rng.Uniform(0.8, 1.2) * direction.normalized()});
      for (int i = 0; i < kPoses; ++i) {
        Eigen::Vector2d pixel;
        ASSERT_TRUE(camera.Project(truth.poses[i].cam_from_world * truth.points.back().position, &pixel));
        const Eigen::Vector2d noise(rng.Uniform(-1.0, 1.0), rng.Uniform(-1.0, 1.0));
        truth.observations.push_back({.pose_idx = i,
                                      .point_idx = static_cast<std::int32_t>(truth.points.size()) - 1,
                                      .pixel = pixel + 0.5 * noise,
                                      .sigma_px = 0.3});
      }
    }
    BundleProblem problem = truth;
    for (BundlePose& pose : problem.poses) {
      if (pose.is_fixed) continue;
      for (double& x : pose.cam_from_world.translation) x += 0.001 * rng.Uniform(-1.0, 1.0);
    }
    for (BundlePoint& point : problem.points) point.position *= 1.0 + 0.03 * rng.Uniform(-1.0, 1.0);
    ASSERT_TRUE(Adjust(camera, BundleOptions(), &problem).ok());
    std::vector<double> ratios;
    for (std::size_t i = 0; i < truth.points.size(); ++i) {
      ratios.push_back(problem.points[i].position.norm() / truth.points[i].position.norm());
    }
    std::nth_element(ratios.begin(), ratios.begin() + 150, ratios.end());
    worst = std::max(worst, std::abs(std::log(ratios[150])));
  }
  EXPECT_LT(worst, 0.02);
}

TEST_P(BundleAdjustment, TwoViewsGiveTheRelativePoseUpToScale) {
  const SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 2,
                                                      .num_points = 200,
                                                      .mean_track_length = 2.0,
                                                      .num_fixed_poses = 1,
                                                      .pixel_noise_sigmas = 0.0,
                                                      .seed = 5});
  BundleProblem problem = bundle.start;
  BundleOptions options;
  options.max_iterations = 60;

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_LT(summary->final_cost, 1e-4);
  EXPECT_LT(MaxRotationError(problem, bundle.truth), 1e-4);
  const SE3 second_from_first = problem.poses[1].cam_from_world * problem.poses[0].cam_from_world.Inverse();
  const SE3 expected = bundle.truth.poses[1].cam_from_world * bundle.truth.poses[0].cam_from_world.Inverse();
  EXPECT_GT(second_from_first.translation.normalized().dot(expected.translation.normalized()), std::cos(0.005));
}

TEST_P(BundleAdjustment, AllPointsFixedGivesThePosesAlone) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.pixel_noise_sigmas = 0.0;
  scene.point_noise_radii = 0.0;
  scene.num_fixed_poses = 0;
  SyntheticBundle bundle = MakeSyntheticBundle(scene);
  for (BundlePoint& point : bundle.start.points) point.is_fixed = true;
  BundleProblem problem = bundle.start;

  const Result<BundleSummary> summary = Adjust(bundle.camera, BundleOptions(), &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_LT(MaxCentreError(problem, bundle.truth), 1e-7);
  EXPECT_LT(MaxRotationError(problem, bundle.truth), 1e-7);
}

TEST_P(BundleAdjustment, AllPosesFixedGivesThePointsAlone) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.pixel_noise_sigmas = 0.0;
  scene.num_fixed_poses = scene.num_poses;
  const SyntheticBundle bundle = MakeSyntheticBundle(scene);
  BundleProblem problem = bundle.start;
  BundleOptions options;
  options.max_iterations = 40;

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_LT(MaxPointError(problem, bundle.truth), 1e-3);
}

TEST_P(BundleAdjustment, PointBehindTheCameraIsFlaggedAndStopsNothing) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  BundleProblem problem = bundle.start;
  const auto behind = static_cast<std::int32_t>(problem.points.size());
  problem.points.push_back({.position = {0.0, 0.0, -5.0}});
  problem.observations.push_back({.pose_idx = 2, .point_idx = behind, .pixel = {360, 270}});
  problem.observations.push_back({.pose_idx = 3, .point_idx = behind, .pixel = {361, 270}});
  BundleProblem reference = bundle.start;

  const Result<BundleSummary> summary = Adjust(bundle.camera, BundleOptions(), &problem);
  const Result<BundleSummary> expected = Adjust(bundle.camera, BundleOptions(), &reference);

  ASSERT_TRUE(summary.ok());
  ASSERT_TRUE(expected.ok());
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_TRUE(problem.observations[problem.observations.size() - 1].is_outlier);
  EXPECT_TRUE(problem.observations[problem.observations.size() - 2].is_outlier);
  EXPECT_EQ(summary->num_outliers, expected->num_outliers + 2);
  EXPECT_LT(MaxCentreError(reference, bundle.truth), 0.02);
  for (std::size_t i = 0; i < reference.poses.size(); ++i) {
    EXPECT_LT((problem.poses[i].cam_from_world.translation - reference.poses[i].cam_from_world.translation).norm(),
              1e-4);
  }
}

TEST_P(BundleAdjustment, CancelledBeforeItStartsLeavesTheGeometry) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  BundleProblem problem = bundle.start;
  BundleOptions options;
  options.should_stop = [] { return true; };

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kNone);
  EXPECT_EQ(summary->iterations, 0);
  EXPECT_TRUE(IsSameGeometry(problem, bundle.start));
}

TEST_P(BundleAdjustment, CancelledMidwayKeepsTheBestStateSoFar) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  SteppingClock clock;
  clock.cancel_at_look = 4;
  BundleOptions options;
  options.max_iterations = 20;
  options.clock = &clock;
  options.deadline = TimePoint(std::chrono::hours(1));
  options.should_stop = [&clock] { return clock.cancel.load(); };
  BundleProblem problem = bundle.start;

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kPartial);
  EXPECT_GE(summary->iterations, 1);
  EXPECT_LE(summary->iterations, 4);
  EXPECT_LT(summary->final_cost, summary->initial_cost);
  EXPECT_FALSE(IsSameGeometry(problem, bundle.start));
}

TEST_P(BundleAdjustment, DeadlineStopsItWithTheBestStateSoFar) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  SteppingClock clock;
  BundleOptions options;
  options.max_iterations = 20;
  options.clock = &clock;
  options.deadline = TimePoint(std::chrono::milliseconds(4));
  BundleProblem problem = bundle.start;

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kPartial);
  EXPECT_GE(summary->iterations, 1);
  EXPECT_LE(summary->iterations, 3);
  EXPECT_LT(summary->final_cost, summary->initial_cost);
}

// Flags of an earlier call do not survive either.
TEST_P(BundleAdjustment, StoppedAnywhereItCallsNothingAnOutlier) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.outlier_share = 0.05;
  const SyntheticBundle bundle = MakeSyntheticBundle(scene);
  bool is_finished = false;
  int num_partial = 0;
  for (int milliseconds = 1; milliseconds < 100 && !is_finished; ++milliseconds) {
    SteppingClock clock;
    BundleOptions options;
    options.clock = &clock;
    options.deadline = TimePoint(std::chrono::milliseconds(milliseconds));
    BundleProblem problem = bundle.start;
    for (BundleObservation& observation : problem.observations) observation.is_outlier = true;
    const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);
    ASSERT_TRUE(summary.ok());
    int num_flagged = 0;
    for (const BundleObservation& observation : problem.observations) num_flagged += observation.is_outlier;
    EXPECT_EQ(summary->num_outliers, num_flagged);
    is_finished = summary->state == SolveState::kConverged;
    num_partial += summary->state == SolveState::kPartial;
    if (is_finished) {
      EXPECT_GT(num_flagged, 0);
    } else {
      EXPECT_EQ(num_flagged, 0) << milliseconds;
    }
    EXPECT_EQ(IsSameGeometry(problem, bundle.start), summary->state == SolveState::kNone) << milliseconds;
  }
  EXPECT_TRUE(is_finished);
  EXPECT_GT(num_partial, 0);
}

TEST_P(BundleAdjustment, FarDeadlineChangesNothing) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  SteppingClock clock;
  BundleOptions options;
  BundleProblem expected = bundle.start;
  ASSERT_TRUE(Adjust(bundle.camera, options, &expected).ok());
  options.clock = &clock;
  options.deadline = TimePoint(std::chrono::hours(1));
  BundleProblem problem = bundle.start;

  const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_TRUE(IsSameGeometry(problem, expected));
}

TEST_P(BundleAdjustment, SameInputGivesTheSameBits) {
  SyntheticBundleOptions scene = SmallWindow();
  scene.outlier_share = 0.05;
  const SyntheticBundle bundle = MakeSyntheticBundle(scene);
  BundleProblem first = bundle.start;
  const BundleSummary first_summary = Adjust(bundle.camera, BundleOptions(), &first).value();
  for (int run = 0; run < 3; ++run) {
    // Other addresses on every run: an order by address must not show.
    BundleProblem again;
    again.poses.reserve(100 * (run + 1));
    again.points.reserve(7919 * (run + 1));
    again = bundle.start;
    const BundleSummary summary = Adjust(bundle.camera, BundleOptions(), &again).value();
    EXPECT_TRUE(IsSameGeometry(first, again));
    EXPECT_EQ(summary.final_cost, first_summary.final_cost);
    EXPECT_EQ(summary.iterations, first_summary.iterations);
  }
}

TEST_P(BundleAdjustment, IterationsStayInsideTheirLimit) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  for (const int limit : {1, 2, 3, 7}) {
    BundleOptions options;
    options.max_iterations = limit;
    BundleProblem problem = bundle.start;
    const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);
    ASSERT_TRUE(summary.ok());
    EXPECT_LE(summary->iterations, limit);
    EXPECT_LT(summary->final_cost, summary->initial_cost);
  }
}

TEST_P(BundleAdjustment, EmptyProblemHasNoSolution) {
  const CameraModel camera = SyntheticEndoscope();
  BundleProblem problem;
  const Result<BundleSummary> summary = Adjust(camera, BundleOptions(), &problem);
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kNone);
  EXPECT_EQ(summary->iterations, 0);
}

TEST_P(BundleAdjustment, EverythingFixedHasACostAndNoVerdict) {
  SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  for (BundlePose& pose : bundle.start.poses) pose.is_fixed = true;
  for (BundlePoint& point : bundle.start.points) point.is_fixed = true;
  BundleProblem problem = bundle.start;
  const Result<BundleSummary> summary = Adjust(bundle.camera, BundleOptions(), &problem);
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kNone);
  EXPECT_EQ(summary->num_outliers, 0);
  EXPECT_NEAR(summary->final_cost, summary->initial_cost, 1e-12 * summary->initial_cost);
  EXPECT_TRUE(IsSameGeometry(problem, bundle.start));
}

TEST_P(BundleAdjustment, PointSeenOnceStaysFinite) {
  // One observation leaves the depth open: the damping must hold it.
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  BundleProblem problem = bundle.start;
  problem.points.push_back({.position = {0.3, 0.2, 2.0}});
  problem.observations.push_back(
      {.pose_idx = 3, .point_idx = static_cast<std::int32_t>(problem.points.size()) - 1, .pixel = {400, 300}});
  const Result<BundleSummary> summary = Adjust(bundle.camera, BundleOptions(), &problem);
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_TRUE(problem.points.back().position.allFinite());
  EXPECT_FALSE(problem.observations.back().is_outlier);
}

// Beyond the windows of the mapper Ceres takes its sparse solver.
TEST(AdjustBundle, MorePosesThanADenseWindowGiveTheTruthToo) {
  const SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 230,
                                                      .num_points = 1500,
                                                      .mean_track_length = 6.0,
                                                      .pixel_noise_sigmas = 0.0,
                                                      .pose_noise_rad = 0.002,
                                                      .point_noise_radii = 0.005});
  BundleProblem problem = bundle.start;
  BundleOptions options;
  options.max_iterations = 20;

  const Result<BundleSummary> summary = AdjustBundle(bundle.camera, options, &problem);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_EQ(summary->num_outliers, 0);
  EXPECT_LT(summary->final_cost, 1e-6 * summary->initial_cost);
}

TEST_P(BundleAdjustment, BadInputIsRefusedByNameAndTouchesNothing) {
  const SyntheticBundle bundle = MakeSyntheticBundle(SmallWindow());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    const char* message;
    void (*spoil)(BundleProblem*, BundleOptions*, double);
  };
  const Case cases[] = {
      {"observations[5].pose_idx is 7",
       [](BundleProblem* p, BundleOptions*, double) { p->observations[5].pose_idx = 7; }},
      {"observations[6].pose_idx is -1",
       [](BundleProblem* p, BundleOptions*, double) { p->observations[6].pose_idx = -1; }},
      {"observations[0].point_idx is 220",
       [](BundleProblem* p, BundleOptions*, double) { p->observations[0].point_idx = 220; }},
      {"observations[2].sigma_px", [](BundleProblem* p, BundleOptions*, double) { p->observations[2].sigma_px = 0.0; }},
      {"observations[2].pixel", [](BundleProblem* p, BundleOptions*, double v) { p->observations[2].pixel.x() = v; }},
      {"points[9]", [](BundleProblem* p, BundleOptions*, double v) { p->points[9].position.z() = v; }},
      {"poses[3]", [](BundleProblem* p, BundleOptions*, double v) { p->poses[3].cam_from_world.translation.z() = v; }},
      {"max_iterations", [](BundleProblem*, BundleOptions* o, double) { o->max_iterations = 0; }},
      {"chi2_gate", [](BundleProblem*, BundleOptions* o, double v) { o->chi2_gate = v; }},
      {"clock", [](BundleProblem*, BundleOptions* o, double) { o->deadline = TimePoint(Duration(5)); }},
  };
  for (const Case& c : cases) {
    BundleProblem problem = bundle.start;
    BundleOptions options;
    c.spoil(&problem, &options, nan);
    const Result<BundleSummary> summary = Adjust(bundle.camera, options, &problem);
    ASSERT_FALSE(summary.ok()) << c.message;
    EXPECT_EQ(summary.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(summary.status().message().find(c.message), std::string::npos) << summary.status().message();
    EXPECT_TRUE(IsSamePose(problem.poses[2], bundle.start.poses[2]));
  }
}

}  // namespace
}  // namespace haustra
