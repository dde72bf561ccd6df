#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/geometry/sim3_ransac.h"
#include "engine/optim/sim3_optimizer.h"
#include "tests/geometry/allocation_counter.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

struct TwiceMappedScene {
  Sim3 truth;  // b_from_a
  std::vector<SE3> views_a, views_b;
  std::vector<Sim3Match> matches;
  int num_true = 0;
};

// A tube mapped twice, by two cameras each time, the points of both maps a little off; the last share of the matches is
// paired at random.
TwiceMappedScene MakeTwiceMappedScene(Rng& rng, int count, double outlier_share, double noise = 1.0) {
  const CameraModel camera = test::ColonCamera();
  TwiceMappedScene scene;
  scene.truth = Sim3(std::exp(rng.Uniform(-1.5, 1.5)), test::RandomRotation(rng, 3.0), test::GaussianVector(rng, 3.0));
  scene.num_true = static_cast<int>(count * (1.0 - outlier_share));
  for (int k = 0; k < 2; ++k) {
    scene.views_a.push_back(SE3(test::RandomRotation(rng, 0.2), test::GaussianVector(rng, 0.15)));
    const SE3 second_visit(test::RandomRotation(rng, 0.2), test::GaussianVector(rng, 0.15));
    scene.views_b.push_back(TransformPose(second_visit, scene.truth));
  }
  const auto seen = [&](const SE3& view, const Eigen::Vector3d& point, double sigma, Eigen::Vector2d* pixel) {
    if (!camera.Project(view * point, pixel) || !camera.IsInImage(*pixel)) return false;
    pixel->x() += noise * sigma * test::Gaussian(rng);
    pixel->y() += noise * sigma * test::Gaussian(rng);
    return true;
  };
  while (static_cast<int>(scene.matches.size()) < count) {
    Sim3Match match;
    match.view_a = static_cast<int>(rng.UniformInt(2));
    match.view_b = static_cast<int>(rng.UniformInt(2));
    match.sigma_a_px = rng.Uniform(1.0, 3.0);
    match.sigma_b_px = rng.Uniform(1.0, 3.0);
    const bool is_true = static_cast<int>(scene.matches.size()) < scene.num_true;
    const Eigen::Vector3d in_a = test::TubePoint(rng, 4.0);
    const Eigen::Vector3d in_b = scene.truth * (is_true ? in_a : test::TubePoint(rng, 4.0));
    match.point_in_a = in_a + test::GaussianVector(rng, noise * 0.002);
    match.point_in_b = in_b + test::GaussianVector(rng, noise * 0.002 * scene.truth.scale);
    if (!seen(scene.views_a[match.view_a], in_a, match.sigma_a_px, &match.pixel_in_a)) continue;
    if (!seen(scene.views_b[match.view_b], in_b, match.sigma_b_px, &match.pixel_in_b)) continue;
    scene.matches.push_back(match);
  }
  return scene;
}

bool IsNear(const Sim3& estimate, const Sim3& truth, double tolerance) {
  // Compared where the points are, in the units of map b.
  const Eigen::Vector3d probe(0.5, -0.5, 2.0);
  return std::abs(std::log(estimate.scale / truth.scale)) < tolerance &&
         RotationAngle(estimate.rotation, truth.rotation) < tolerance &&
         (estimate * probe - truth * probe).norm() < 2.0 * tolerance * truth.scale;
}

TEST(Sim3Ransac, FindsTheSimilarityAmongHalfOutliers) {
  Rng rng(1);
  const CameraModel camera = test::ColonCamera();
  Sim3Ransac ransac(300);
  constexpr int kTrials = test::Trials(300);
  int succeeded = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const TwiceMappedScene scene = MakeTwiceMappedScene(rng, 100, 0.5);
    Sim3Ransac::Estimate estimate;
    if (!ransac.Run(camera, scene.matches, scene.views_a, scene.views_b, {}, rng, &estimate)) continue;
    int true_found = 0;
    for (int i = 0; i < scene.num_true; ++i) true_found += ransac.inliers()[i];
    if (IsNear(estimate.b_from_a, scene.truth, 0.01) && true_found >= 35 && estimate.num_inliers - true_found <= 2) {
      ++succeeded;
    }
  }
  EXPECT_GE(succeeded, kTrials * 99 / 100);
}

TEST(Sim3Ransac, ChanceAndDegenerateInputAreRefused) {
  Rng rng(3);
  const CameraModel camera = test::ColonCamera();
  Sim3Ransac ransac(100);
  Sim3Ransac::Estimate estimate;
  estimate.num_inliers = -1;
  const auto expect_refused = [&](const TwiceMappedScene& scene) {
    EXPECT_FALSE(ransac.Run(camera, scene.matches, scene.views_a, scene.views_b, {}, rng, &estimate));
    EXPECT_EQ(std::count(ransac.inliers().begin(), ransac.inliers().end(), 1), 0);
    EXPECT_EQ(estimate.num_inliers, -1);
  };
  for (int trial = 0; trial < 30; ++trial) expect_refused(MakeTwiceMappedScene(rng, 100, 1.0));
  expect_refused(MakeTwiceMappedScene(rng, 11, 0.0));
  expect_refused(MakeTwiceMappedScene(rng, 101, 0.0));
  expect_refused(TwiceMappedScene{});
  TwiceMappedScene no_view = MakeTwiceMappedScene(rng, 50, 0.0);
  no_view.matches[7].view_b = 2;
  expect_refused(no_view);
  TwiceMappedScene line = MakeTwiceMappedScene(rng, 50, 0.0);
  for (int i = 0; i < 50; ++i) line.matches[i].point_in_a = Eigen::Vector3d(0.01 * i, 0.0, 2.0);
  expect_refused(line);
}

TEST(Sim3Ransac, SameSeedGivesTheSameBits) {
  Rng scene_rng(4);
  const CameraModel camera = test::ColonCamera();
  const TwiceMappedScene scene = MakeTwiceMappedScene(scene_rng, 100, 0.5);
  Sim3Ransac ransac(100);
  Rng a(5), b(5);
  Sim3Ransac::Estimate first, second;
  ASSERT_TRUE(ransac.Run(camera, scene.matches, scene.views_a, scene.views_b, {}, a, &first));
  ASSERT_TRUE(ransac.Run(camera, scene.matches, scene.views_a, scene.views_b, {}, b, &second));
  EXPECT_EQ(first.b_from_a.scale, second.b_from_a.scale);
  EXPECT_EQ(first.b_from_a.translation, second.b_from_a.translation);
}

TEST(Sim3Optimizer, ConvergesToTheTruthFromAPoorStartAmongOutliers) {
  Rng rng(6);
  const CameraModel camera = test::ColonCamera();
  constexpr int kTrials = test::Trials(200);
  int succeeded = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const TwiceMappedScene scene = MakeTwiceMappedScene(rng, 120, 0.2);
    Vector7d off;
    off << test::GaussianVector(rng, 0.02 * scene.truth.scale), test::GaussianVector(rng, 0.02), 0.04;
    // Disturbed about the middle of the points, not about the far origin of map b.
    const Sim3 to_middle(1.0, Eigen::Quaterniond::Identity(), -(scene.truth * Eigen::Vector3d(0, 0, 2)));
    const Sim3 start = to_middle.Inverse() * Sim3FromTangent(off) * to_middle * scene.truth;
    std::vector<std::uint8_t> inliers(scene.matches.size());
    Sim3OptimizerResult result;
    if (!OptimizeSim3(camera, scene.matches, scene.views_a, scene.views_b, start, {}, inliers, &result)) continue;
    int true_found = 0;
    for (int i = 0; i < scene.num_true; ++i) true_found += inliers[i];
    // Views from nearly one place leave the scale loose: judged by the information that is returned. Chi-square of
    // seven degrees of freedom, 99.9 % below 24; the noise of the points is not in the sigmas and adds about a half.
    const Sim3 difference = scene.truth * result.b_from_a.Inverse();
    Vector7d error;
    error << difference.translation, LogSO3(difference.rotation), std::log(difference.scale);
    if (error.dot(result.information * error) < 40.0 && true_found > 0.8 * scene.num_true) ++succeeded;
  }
  EXPECT_GE(succeeded, kTrials * 99 / 100);
}

TEST(Sim3Optimizer, ExactDataGivesTheExactSimilarity) {
  Rng rng(7);
  const CameraModel camera = test::ColonCamera();
  for (int trial = 0; trial < 20; ++trial) {
    const TwiceMappedScene scene = MakeTwiceMappedScene(rng, 40, 0.0, 0.0);
    Vector7d off;
    off << test::GaussianVector(rng, 0.005), test::GaussianVector(rng, 0.005), 0.01;
    std::vector<std::uint8_t> inliers(scene.matches.size());
    Sim3OptimizerResult result;
    ASSERT_TRUE(OptimizeSim3(camera, scene.matches, scene.views_a, scene.views_b, Sim3FromTangent(off) * scene.truth,
                             {}, inliers, &result));
    EXPECT_TRUE(IsNear(result.b_from_a, scene.truth, 1e-6));
    EXPECT_EQ(result.num_inliers, 40);
  }
}

TEST(Sim3Optimizer, InformationIsTheCurvatureOfTheCost) {
  Rng rng(8);
  const CameraModel camera = test::ColonCamera();
  const TwiceMappedScene scene = MakeTwiceMappedScene(rng, 60, 0.0, 0.3);
  Sim3OptimizerOptions options;
  options.chi2_gate = 1e4;
  std::vector<std::uint8_t> inliers(scene.matches.size());
  Sim3OptimizerResult result;
  ASSERT_TRUE(
      OptimizeSim3(camera, scene.matches, scene.views_a, scene.views_b, scene.truth, options, inliers, &result));
  const auto cost = [&](const Vector7d& step) {
    const Sim3 b_from_a = Sim3FromTangent(step) * result.b_from_a, a_from_b = b_from_a.Inverse();
    double sum = 0.0;
    for (const Sim3Match& match : scene.matches) {
      Eigen::Vector2d a, b;
      EXPECT_TRUE(camera.Project(scene.views_b[match.view_b] * (b_from_a * match.point_in_a), &b));
      EXPECT_TRUE(camera.Project(scene.views_a[match.view_a] * (a_from_b * match.point_in_b), &a));
      sum += 0.5 * ((a - match.pixel_in_a) / match.sigma_a_px).squaredNorm() +
             0.5 * ((b - match.pixel_in_b) / match.sigma_b_px).squaredNorm();
    }
    return sum;
  };
  for (int axis = 0; axis < 7; ++axis) {
    const double h = 0.1 / std::sqrt(result.information(axis, axis));
    const Vector7d step = h * Vector7d::Unit(axis);
    const double curvature = (cost(step) + cost(-step) - 2.0 * cost(Vector7d::Zero())) / (h * h);
    EXPECT_NEAR(curvature, result.information(axis, axis), 0.05 * result.information(axis, axis)) << axis;
    EXPECT_LT(std::abs(cost(step) - cost(-step)) / 0.2, 0.02) << axis;  // slope in standard deviations
  }
}

TEST(Sim3Optimizer, UselessInputGivesTheInitialSimilarityBack) {
  Rng rng(9);
  const CameraModel camera = test::ColonCamera();
  const TwiceMappedScene scene = MakeTwiceMappedScene(rng, 30, 0.0);
  std::vector<std::uint8_t> inliers(scene.matches.size());
  Sim3OptimizerResult result;
  const Sim3 far = Sim3(1.0, Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d(1000, 0, 0)) * scene.truth;
  EXPECT_FALSE(OptimizeSim3(camera, scene.matches, scene.views_a, scene.views_b, far, {}, inliers, &result));
  EXPECT_EQ(result.b_from_a.translation, far.translation);
  EXPECT_FALSE(OptimizeSim3(camera, scene.matches, {}, scene.views_b, scene.truth, {}, inliers, &result));
  EXPECT_FALSE(OptimizeSim3(camera, {}, scene.views_a, scene.views_b, scene.truth, {}, {}, &result));
  const std::vector<Sim3Match> same(30, scene.matches[0]);
  EXPECT_FALSE(OptimizeSim3(camera, same, scene.views_a, scene.views_b, scene.truth, {}, inliers, &result));
}

TEST(Sim3, EstimatorsNeverAllocate) {
  if (!test::AllocationCounter::IsAvailable()) GTEST_SKIP() << "the sanitizer owns malloc";
  Rng rng(10);
  const CameraModel camera = test::ColonCamera();
  const TwiceMappedScene scene = MakeTwiceMappedScene(rng, 100, 0.4);
  Sim3Ransac ransac(100);
  Sim3Ransac::Estimate estimate;
  std::vector<std::uint8_t> inliers(scene.matches.size());
  Sim3OptimizerResult result;
  const test::AllocationCounter counter;
  const bool found = ransac.Run(camera, scene.matches, scene.views_a, scene.views_b, {}, rng, &estimate);
  const bool refined =
      OptimizeSim3(camera, scene.matches, scene.views_a, scene.views_b, estimate.b_from_a, {}, inliers, &result);
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(found);
  EXPECT_TRUE(refined);
}

}  // namespace
}  // namespace haustra
