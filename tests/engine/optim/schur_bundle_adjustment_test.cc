// What bundle_adjustment_test.cc does not say of this implementation: agreement with its twin, and memory that is
// reused.
#include "engine/optim/schur_bundle_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "engine/optim/benchmarks/synthetic_bundle.h"

namespace haustra {
namespace {

bool IsSameSolution(const BundleProblem& a, const BundleProblem& b) {
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    if (a.poses[i].cam_from_world.translation != b.poses[i].cam_from_world.translation ||
        a.poses[i].cam_from_world.rotation.coeffs() != b.poses[i].cam_from_world.rotation.coeffs()) {
      return false;
    }
  }
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    if (a.points[i].position != b.points[i].position) return false;
  }
  return true;
}

double MaxCentreDifference(const BundleProblem& a, const BundleProblem& b) {
  double difference = 0.0;
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    difference = std::max(
        difference,
        (a.poses[i].cam_from_world.InverseTranslation() - b.poses[i].cam_from_world.InverseTranslation()).norm());
  }
  return difference;
}

class SchurBundleAdjustmentTwin : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Seeds, SchurBundleAdjustmentTwin, ::testing::Range(1, 7));

TEST_P(SchurBundleAdjustmentTwin, FindsTheMinimumThatCeresFinds) {
  const SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 10,
                                                      .num_points = 400,
                                                      .mean_track_length = 5.0,
                                                      .num_fixed_poses = 1 + GetParam() % 3,
                                                      .pixel_noise_sigmas = 0.4,
                                                      .seed = static_cast<std::uint64_t>(GetParam())});
  BundleOptions options;
  options.max_iterations = 60;
  BundleProblem expected = bundle.start;
  const BundleSummary ceres = AdjustBundle(bundle.camera, options, &expected).value();
  BundleProblem problem = bundle.start;
  const BundleSummary schur = AdjustBundleSchur(bundle.camera, options, &problem).value();

  EXPECT_NEAR(schur.initial_cost, ceres.initial_cost, 1e-9 * ceres.initial_cost);
  EXPECT_NEAR(schur.final_cost, ceres.final_cost, 1e-3 * ceres.final_cost);
  EXPECT_EQ(schur.num_outliers, ceres.num_outliers);
  // Both stop when the cost has settled; what is left between them is small against what noise leaves.
  EXPECT_LT(MaxCentreDifference(problem, expected), 0.2 * MaxCentreDifference(expected, bundle.truth));
}

TEST_P(SchurBundleAdjustmentTwin, RejectsTheOutliersThatCeresRejects) {
  const SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 10,
                                                      .num_points = 400,
                                                      .mean_track_length = 7.0,
                                                      .pixel_noise_sigmas = 0.3,
                                                      .outlier_share = 0.05,
                                                      .seed = static_cast<std::uint64_t>(GetParam())});
  BundleOptions options;
  options.max_iterations = 60;
  BundleProblem expected = bundle.start;
  ASSERT_TRUE(AdjustBundle(bundle.camera, options, &expected).ok());
  BundleProblem problem = bundle.start;
  ASSERT_TRUE(AdjustBundleSchur(bundle.camera, options, &problem).ok());

  int num_outliers = 0, num_different = 0;
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    num_outliers += expected.observations[i].is_outlier;
    num_different += expected.observations[i].is_outlier != problem.observations[i].is_outlier;
  }
  EXPECT_GT(num_outliers, 100);
  EXPECT_LE(num_different, num_outliers / 20);
}

TEST(SchurBundleAdjuster, MemoryOfEarlierCallsDoesNotShow) {
  const SyntheticBundle large = MakeSyntheticBundle({.num_poses = 12, .num_points = 500, .outlier_share = 0.1});
  const SyntheticBundle small =
      MakeSyntheticBundle({.num_poses = 5, .num_points = 90, .mean_track_length = 3.5, .seed = 2});
  SchurBundleAdjuster adjuster;
  for (const SyntheticBundle* bundle : {&large, &small, &large, &small}) {
    BundleProblem reused = bundle->start;
    BundleProblem fresh = bundle->start;
    const BundleSummary summary = adjuster.Adjust(bundle->camera, BundleOptions(), &reused).value();
    const BundleSummary expected = AdjustBundleSchur(bundle->camera, BundleOptions(), &fresh).value();
    EXPECT_TRUE(IsSameSolution(reused, fresh));
    EXPECT_EQ(summary.final_cost, expected.final_cost);
    EXPECT_EQ(summary.num_outliers, expected.num_outliers);
  }
}

TEST(SchurBundleAdjuster, InstructionSetsDifferByRoundingOnly) {
  const SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 9, .num_points = 301, .outlier_share = 0.05});
  SchurBundleAdjuster portable(optim::BundleKernelsFor(optim::VectorLevel::kPortable));
  BundleProblem expected = bundle.start;
  const BundleSummary reference = portable.Adjust(bundle.camera, BundleOptions(), &expected).value();
  BundleProblem problem = bundle.start;
  const BundleSummary best = AdjustBundleSchur(bundle.camera, BundleOptions(), &problem).value();
  EXPECT_EQ(best.iterations, reference.iterations);
  EXPECT_EQ(best.num_outliers, reference.num_outliers);
  EXPECT_NEAR(best.final_cost, reference.final_cost, 1e-9 * reference.final_cost);
  EXPECT_LT(MaxCentreDifference(problem, expected), 1e-9);
}

TEST(SchurBundleAdjuster, OrderOfObservationsOfDifferentPointsDoesNotMatter) {
  // The mapper may hand them over by keyframe or by point.
  const SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 6, .num_points = 150, .mean_track_length = 4.0});
  BundleProblem by_pose = bundle.start;
  BundleProblem by_point = bundle.start;
  std::stable_sort(by_point.observations.begin(), by_point.observations.end(),
                   [](const BundleObservation& a, const BundleObservation& b) { return a.point_idx < b.point_idx; });
  ASSERT_TRUE(AdjustBundleSchur(bundle.camera, BundleOptions(), &by_pose).ok());
  ASSERT_TRUE(AdjustBundleSchur(bundle.camera, BundleOptions(), &by_point).ok());
  EXPECT_TRUE(IsSameSolution(by_pose, by_point));
}

}  // namespace
}  // namespace haustra
