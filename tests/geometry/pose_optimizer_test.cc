#include "engine/optim/pose_optimizer.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/geometry/constants.h"
#include "tests/geometry/allocation_counter.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

struct TrackedScene {
  SE3 truth;
  std::vector<PoseObservation> observations;
  int num_true = 0;
};

// Points of a tube; each observation has its own sigma between one and three pixels; the last share is anywhere.
TrackedScene MakeTrackedScene(Rng& rng, int count, double outlier_share, double noise = 1.0) {
  const CameraModel camera = test::ColonCamera();
  TrackedScene scene;
  scene.truth = SE3(test::RandomRotation(rng, 0.4), test::GaussianVector(rng, 0.2));
  scene.num_true = static_cast<int>(count * (1.0 - outlier_share));
  while (static_cast<int>(scene.observations.size()) < count) {
    PoseObservation observation;
    observation.point_in_world = test::TubePoint(rng, 4.0);
    observation.sigma_px = rng.Uniform(1.0, 3.0);
    if (!camera.Project(scene.truth * observation.point_in_world, &observation.pixel)) continue;
    if (!camera.IsInImage(observation.pixel)) continue;
    if (static_cast<int>(scene.observations.size()) < scene.num_true) {
      observation.pixel.x() += noise * observation.sigma_px * test::Gaussian(rng);
      observation.pixel.y() += noise * observation.sigma_px * test::Gaussian(rng);
    } else {
      observation.pixel = {rng.Uniform(0.0, 719.0), rng.Uniform(0.0, 539.0)};
    }
    scene.observations.push_back(observation);
  }
  return scene;
}

// Off by `angle_rad` and `distance` (the tube has radius 1).
SE3 Disturbed(Rng& rng, const SE3& pose, double angle_rad, double distance) {
  return SE3(ExpSO3(angle_rad * test::RandomDirection(rng)), distance * test::RandomDirection(rng)) * pose;
}

TEST(PoseOptimizer, FindsTheTruthFromAPoorStartAmongOutliers) {
  Rng rng(1);
  const CameraModel camera = test::ColonCamera();
  constexpr int kTrials = test::Trials(300);
  int succeeded = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const TrackedScene scene = MakeTrackedScene(rng, 200, 0.3);
    std::vector<std::uint8_t> inliers(scene.observations.size());
    PoseOptimizerResult result;
    const SE3 start = Disturbed(rng, scene.truth, 0.08, 0.1);
    if (!OptimizePose(camera, scene.observations, start, {}, inliers, &result)) continue;
    int true_found = 0;
    for (int i = 0; i < scene.num_true; ++i) true_found += inliers[i];
    const Vector6d error = (scene.truth * result.cam_from_world.Inverse()).Log();
    // Mahalanobis distance by the information that is returned: chi-square of six degrees of freedom, 99.9 %
    // below 22.5; the gate removes some true observations, which leaves a little more spread.
    if (error.dot(result.information * error) < 30.0 && true_found > 0.88 * scene.num_true) ++succeeded;
  }
  EXPECT_GE(succeeded, kTrials * 99 / 100);
}

TEST(PoseOptimizer, FindsTheTruthAmongHalfOutliersFromATrackersStart) {
  Rng rng(2);
  const CameraModel camera = test::ColonCamera();
  constexpr int kTrials = test::Trials(300);
  int succeeded = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const TrackedScene scene = MakeTrackedScene(rng, 100, 0.5);
    std::vector<std::uint8_t> inliers(scene.observations.size());
    PoseOptimizerResult result;
    const SE3 start = Disturbed(rng, scene.truth, 0.03, 0.04);
    if (!OptimizePose(camera, scene.observations, start, {}, inliers, &result)) continue;
    const Vector6d error = (scene.truth * result.cam_from_world.Inverse()).Log();
    if (error.dot(result.information * error) < 30.0) ++succeeded;
  }
  EXPECT_GE(succeeded, kTrials * 99 / 100);
}

TEST(PoseOptimizer, PointsTriangulatedWronglyJustInFrontOfTheCameraDoNotPullThePose) {
  // Six of a hundred, each moving by hundreds of pixels for a small step of the pose: with a cost that goes on rising
  // with the error they win in one trial of sixteen.
  Rng rng(12);
  const CameraModel camera = test::ColonCamera();
  constexpr int kTrials = test::Trials(300);
  int succeeded = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    TrackedScene scene = MakeTrackedScene(rng, 100, 0.2);
    for (int i = 80; i < 86; ++i) {
      scene.observations[i].point_in_world =
          scene.truth.Inverse() * (rng.Uniform(0.1, 0.3) * test::RandomBearing(rng, camera));
    }
    std::vector<std::uint8_t> inliers(scene.observations.size());
    PoseOptimizerResult result;
    const SE3 start = Disturbed(rng, scene.truth, 0.005, 0.005);
    if (!OptimizePose(camera, scene.observations, start, {}, inliers, &result)) continue;
    const Vector6d error = (scene.truth * result.cam_from_world.Inverse()).Log();
    if (error.dot(result.information * error) < 30.0) ++succeeded;
  }
  EXPECT_GE(succeeded, kTrials * 98 / 100);
}

TEST(PoseOptimizer, InformationPredictsTheSpreadOfTheResult) {
  Rng rng(3);
  const CameraModel camera = test::ColonCamera();
  double sum = 0.0;
  constexpr int kTrials = 300;
  PoseOptimizerOptions options;
  options.chi2_gate = 1e3;  // all in: the plain least-squares problem
  for (int trial = 0; trial < kTrials; ++trial) {
    const TrackedScene scene = MakeTrackedScene(rng, 100, 0.0);
    std::vector<std::uint8_t> inliers(scene.observations.size());
    PoseOptimizerResult result;
    ASSERT_TRUE(OptimizePose(camera, scene.observations, scene.truth, options, inliers, &result));
    EXPECT_TRUE(result.converged);
    const Vector6d error = (scene.truth * result.cam_from_world.Inverse()).Log();
    sum += error.dot(result.information * error);
  }
  // Mean of a chi-square of six degrees of freedom: 6 +- 0.2.
  EXPECT_NEAR(sum / kTrials, 6.0, 0.7);
}

TEST(PoseOptimizer, MeanChi2IsTwoWhenSigmasAreRight) {
  Rng rng(4);
  const CameraModel camera = test::ColonCamera();
  const TrackedScene scene = MakeTrackedScene(rng, 2000, 0.0);
  std::vector<std::uint8_t> inliers(scene.observations.size());
  PoseOptimizerResult result;
  PoseOptimizerOptions options;
  options.chi2_gate = 1e3;
  ASSERT_TRUE(OptimizePose(camera, scene.observations, scene.truth, options, inliers, &result));
  EXPECT_EQ(result.num_inliers, 2000);
  EXPECT_NEAR(result.mean_chi2, 2.0, 0.2);
}

TEST(PoseOptimizer, GradientVanishesAtTheResult) {
  // Numeric derivative of the inliers' cost: tests Jacobian and minimiser together against the camera alone.
  Rng rng(5);
  const CameraModel camera = test::ColonCamera();
  const TrackedScene scene = MakeTrackedScene(rng, 200, 0.2);
  std::vector<std::uint8_t> inliers(scene.observations.size());
  PoseOptimizerResult result;
  PoseOptimizerOptions options;
  options.iterations_per_round = 30;
  ASSERT_TRUE(OptimizePose(camera, scene.observations, scene.truth, options, inliers, &result));
  // The last classification may have moved a match on the gate; fit once more on exactly this set.
  std::vector<PoseObservation> kept;
  for (std::size_t i = 0; i < inliers.size(); ++i) {
    if (inliers[i]) kept.push_back(scene.observations[i]);
  }
  options.chi2_gate = 1e3;
  std::vector<std::uint8_t> all(kept.size());
  ASSERT_TRUE(OptimizePose(camera, kept, result.cam_from_world, options, all, &result));
  const auto cost = [&](const SE3& pose) {
    double sum = 0.0;
    for (const PoseObservation& observation : kept) {
      Eigen::Vector2d pixel;
      EXPECT_TRUE(camera.Project(pose * observation.point_in_world, &pixel));
      sum += 0.5 * (pixel - observation.pixel).squaredNorm() / (observation.sigma_px * observation.sigma_px);
    }
    return sum;
  };
  const Matrix6d covariance = result.information.inverse();
  for (int axis = 0; axis < 6; ++axis) {
    const Vector6d h = 1e-5 * Vector6d::Unit(axis);
    const double slope =
        (cost(SE3::Exp(h) * result.cam_from_world) - cost(SE3::Exp(-h) * result.cam_from_world)) / 2e-5;
    EXPECT_LT(std::abs(slope) * std::sqrt(covariance(axis, axis)), 2e-2) << axis;  // in standard deviations
    const double curvature = (cost(SE3::Exp(100 * h) * result.cam_from_world) +
                              cost(SE3::Exp(-100 * h) * result.cam_from_world) - 2.0 * cost(result.cam_from_world)) /
                             1e-6;
    EXPECT_NEAR(curvature, result.information(axis, axis), 0.1 * result.information(axis, axis)) << axis;
  }
}

TEST(PoseOptimizer, ObservationThrownOutEarlyComesBack) {
  // From a start so poor that most true observations lie beyond the gate at first, nearly all are inliers in the end.
  Rng rng(6);
  const CameraModel camera = test::ColonCamera();
  const TrackedScene scene = MakeTrackedScene(rng, 200, 0.0);
  const SE3 start = Disturbed(rng, scene.truth, 0.1, 0.1);
  int outside = 0;
  for (const PoseObservation& observation : scene.observations) {
    Eigen::Vector2d pixel;
    if (!camera.Project(start * observation.point_in_world, &pixel) ||
        (pixel - observation.pixel).squaredNorm() > 5.991 * observation.sigma_px * observation.sigma_px) {
      ++outside;
    }
  }
  ASSERT_GT(outside, 150);
  std::vector<std::uint8_t> inliers(scene.observations.size());
  PoseOptimizerResult result;
  ASSERT_TRUE(OptimizePose(camera, scene.observations, start, {}, inliers, &result));
  EXPECT_GT(result.num_inliers, 180);
}

// Given rounds enough the marks settle, and what is left is plain least squares of what is marked.
TEST(PoseOptimizer, EndsAtTheMinimumOfItsInliers) {
  Rng rng(17);
  const CameraModel camera = test::ColonCamera();
  PoseOptimizerOptions options;
  options.rounds = 40;
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE(trial);
    const TrackedScene scene = MakeTrackedScene(rng, 200, 0.3, 2.0);
    std::vector<std::uint8_t> inliers(scene.observations.size());
    PoseOptimizerResult result;
    const SE3 start = Disturbed(rng, scene.truth, 0.05, 0.05);
    ASSERT_TRUE(OptimizePose(camera, scene.observations, start, options, inliers, &result));
    const auto half_cost = [&](const Vector6d& step) {
      const SE3 cam_from_world = SE3::Exp(step) * result.cam_from_world;
      double sum = 0.0;
      for (std::size_t i = 0; i < inliers.size(); ++i) {
        if (inliers[i] == 0) continue;
        const PoseObservation& observation = scene.observations[i];
        Eigen::Vector2d pixel;
        EXPECT_TRUE(camera.Project(cam_from_world * observation.point_in_world, &pixel));
        sum += ((pixel - observation.pixel) / observation.sigma_px).squaredNorm();
      }
      return 0.5 * sum;
    };
    constexpr double kStep = 1e-5;
    Vector6d gradient;
    for (int i = 0; i < 6; ++i) {
      const Vector6d step = kStep * Vector6d::Unit(i);
      gradient[i] = (half_cost(step) - half_cost(-step)) / (2.0 * kStep);
    }
    // What the cost could still fall by, in squared sigmas.
    EXPECT_LT(gradient.dot(result.information.ldlt().solve(gradient)), 1e-3);
  }
}

TEST(PoseOptimizer, PointsBehindTheCameraAreOutliersAndDoNoHarm) {
  Rng rng(7);
  const CameraModel camera = test::ColonCamera();
  TrackedScene scene = MakeTrackedScene(rng, 100, 0.0);
  for (int i = 0; i < 20; ++i) {
    scene.observations[i].point_in_world =
        scene.truth.Inverse() * Eigen::Vector3d(rng.Uniform(-1, 1), rng.Uniform(-1, 1), -2.0);
  }
  std::vector<std::uint8_t> inliers(scene.observations.size());
  PoseOptimizerResult result;
  ASSERT_TRUE(OptimizePose(camera, scene.observations, Disturbed(rng, scene.truth, 0.03, 0.05), {}, inliers, &result));
  EXPECT_EQ(std::count(inliers.begin(), inliers.begin() + 20, 1), 0);
  EXPECT_GT(result.num_inliers, 65);
}

TEST(PoseOptimizer, UselessInputGivesTheInitialPoseBack) {
  Rng rng(8);
  const CameraModel camera = test::ColonCamera();
  const TrackedScene scene = MakeTrackedScene(rng, 50, 0.0);
  const SE3 start = Disturbed(rng, scene.truth, 0.02, 0.02);
  const auto expect_refused = [&](const std::vector<PoseObservation>& observations) {
    std::vector<std::uint8_t> inliers(observations.size(), 1);
    PoseOptimizerResult result;
    EXPECT_FALSE(OptimizePose(camera, observations, start, {}, inliers, &result));
    EXPECT_EQ(result.cam_from_world.translation, start.translation);
    EXPECT_FALSE(result.converged);
  };
  expect_refused({});
  expect_refused({scene.observations.begin(), scene.observations.begin() + 3});
  // All in one place: the pose is not determined.
  expect_refused(std::vector<PoseObservation>(50, scene.observations[0]));
  // Nothing in front.
  std::vector<PoseObservation> behind = scene.observations;
  for (PoseObservation& observation : behind) {
    observation.point_in_world = start.Inverse() * Eigen::Vector3d(0.0, 0.1, -3.0);
  }
  expect_refused(behind);
  std::vector<std::uint8_t> too_short(3);
  PoseOptimizerResult result;
  EXPECT_FALSE(OptimizePose(camera, scene.observations, start, {}, too_short, &result));
}

TEST(PoseOptimizer, SameInputGivesTheSameBits) {
  Rng rng(9);
  const CameraModel camera = test::ColonCamera();
  const TrackedScene scene = MakeTrackedScene(rng, 200, 0.3);
  std::vector<std::uint8_t> first_inliers(200), second_inliers(200);
  PoseOptimizerResult first, second;
  ASSERT_TRUE(OptimizePose(camera, scene.observations, scene.truth, {}, first_inliers, &first));
  ASSERT_TRUE(OptimizePose(camera, scene.observations, scene.truth, {}, second_inliers, &second));
  EXPECT_EQ(first.cam_from_world.rotation.coeffs(), second.cam_from_world.rotation.coeffs());
  EXPECT_EQ(first.cam_from_world.translation, second.cam_from_world.translation);
  EXPECT_EQ(first.information, second.information);
  EXPECT_EQ(first_inliers, second_inliers);
}

TEST(PoseOptimizer, NeverAllocates) {
  if (!test::AllocationCounter::IsAvailable()) GTEST_SKIP() << "the sanitizer owns malloc";
  Rng rng(10);
  const CameraModel camera = test::ColonCamera();
  const TrackedScene scene = MakeTrackedScene(rng, 200, 0.3);
  const SE3 start = Disturbed(rng, scene.truth, 0.05, 0.05);
  std::vector<std::uint8_t> inliers(scene.observations.size());
  PoseOptimizerResult result;
  const test::AllocationCounter counter;
  const bool found = OptimizePose(camera, scene.observations, start, {}, inliers, &result);
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(found);
}

TEST(PoseOptimizer, UncertaintyIsThatOfTheInverseInformation) {
  Matrix6d information = Matrix6d::Zero();
  information.diagonal() << 100.0, 400.0, 400.0, 1e4, 1e4, 2.5e3;
  const PoseUncertainty uncertainty = UncertaintyOf(information, 2.0);
  EXPECT_NEAR(uncertainty.position_sigma, std::sqrt(0.01 + 0.0025 + 0.0025) / 2.0, 1e-12);
  EXPECT_NEAR(uncertainty.rotation_sigma_deg, std::sqrt(1e-4 + 1e-4 + 4e-4) / kDegree, 1e-9);
  information(2, 2) = 0.0;  // nothing holds the camera along its axis
  EXPECT_TRUE(std::isinf(UncertaintyOf(information, 2.0).position_sigma));
}

}  // namespace
}  // namespace haustra
