#include "engine/geometry/absolute_pose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/geometry/allocation_counter.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

constexpr double kOnePixelRad = 1.0 / 400.0;  // one pixel of the colon camera
constexpr double kPixelTolerance = 2.45 * kOnePixelRad;

struct ResectionScene {
  SE3 truth;
  std::vector<Eigen::Vector3d> bearings, points;
  std::vector<double> tolerance;
  int num_true = 0;
};

// Points of a tube seen from inside, of which the first share are true and the rest paired at random.
ResectionScene MakeResectionScene(Rng& rng, int count, double outlier_share, double sigma_rad) {
  const CameraModel camera = test::ColonCamera();
  ResectionScene scene;
  scene.truth = SE3(test::RandomRotation(rng, 0.4), test::GaussianVector(rng, 0.2));
  scene.num_true = static_cast<int>(count * (1.0 - outlier_share));
  while (static_cast<int>(scene.points.size()) < count) {
    const Eigen::Vector3d point = test::TubePoint(rng, 4.0);
    const Eigen::Vector3d bearing = (scene.truth * point).normalized();
    Eigen::Vector2d pixel;
    if (!camera.Project(bearing, &pixel) || !camera.IsInImage(pixel)) continue;
    const bool is_true = static_cast<int>(scene.points.size()) < scene.num_true;
    scene.points.push_back(point);
    scene.bearings.push_back(is_true ? test::NoisyBearing(rng, bearing, sigma_rad) : test::RandomBearing(rng, camera));
  }
  scene.tolerance.assign(count, kPixelTolerance);
  return scene;
}

TEST(AbsolutePoseRansac, FindsThePoseAmongHalfOutliers) {
  Rng rng(1);
  AbsolutePoseRansac ransac(500);
  constexpr int kTrials = test::Trials(300);
  int succeeded = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ResectionScene scene = MakeResectionScene(rng, 200, 0.5, kOnePixelRad);
    AbsolutePoseRansac::Estimate estimate;
    if (!ransac.Run(scene.bearings, scene.points, scene.tolerance, {}, rng, &estimate)) continue;
    const double turned = RotationAngle(estimate.cam_from_world.rotation, scene.truth.rotation);
    const double moved = (estimate.cam_from_world.InverseTranslation() - scene.truth.InverseTranslation()).norm();
    int true_found = 0;
    for (int i = 0; i < scene.num_true; ++i) true_found += ransac.inliers()[i];
    // A hundred points of a pixel each leave about 2e-3 rad and 3e-3 of the tube's radius.
    if (turned < 5e-3 && moved < 1.2e-2 && true_found >= 85 && estimate.num_inliers <= true_found + 8) ++succeeded;
  }
  EXPECT_GE(succeeded, kTrials * 99 / 100);
}

TEST(AbsolutePoseRansac, FindsThePoseFromFewMatchesAndManyOutliers) {
  Rng rng(2);
  AbsolutePoseRansac ransac(500);
  constexpr int kTrials = test::Trials(200);
  int succeeded = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ResectionScene scene = MakeResectionScene(rng, 80, 0.7, 0.5 * kOnePixelRad);
    AbsolutePoseRansac::Estimate estimate;
    if (!ransac.Run(scene.bearings, scene.points, scene.tolerance, {}, rng, &estimate)) continue;
    if (RotationAngle(estimate.cam_from_world.rotation, scene.truth.rotation) < 5e-3 &&
        (estimate.cam_from_world.translation - scene.truth.translation).norm() < 1e-2) {
      ++succeeded;
    }
  }
  EXPECT_GE(succeeded, kTrials * 99 / 100);
}

TEST(AbsolutePoseRansac, ExactDataGivesTheExactPose) {
  Rng rng(3);
  AbsolutePoseRansac ransac(100);
  const ResectionScene scene = MakeResectionScene(rng, 30, 0.0, 0.0);
  AbsolutePoseRansac::Estimate estimate;
  ASSERT_TRUE(ransac.Run(scene.bearings, scene.points, scene.tolerance, {}, rng, &estimate));
  EXPECT_EQ(estimate.num_inliers, 30);
  EXPECT_LT(RotationAngle(estimate.cam_from_world.rotation, scene.truth.rotation), 1e-9);
  EXPECT_LT((estimate.cam_from_world.translation - scene.truth.translation).norm(), 1e-9);
}

TEST(AbsolutePoseRansac, PointsInOnePlaneAreEnough) {
  Rng rng(4);
  AbsolutePoseRansac ransac(100);
  ResectionScene scene = MakeResectionScene(rng, 60, 0.0, 0.0);
  for (int i = 0; i < 60; ++i) {
    scene.points[i].z() = 3.0;
    scene.bearings[i] = test::NoisyBearing(rng, (scene.truth * scene.points[i]).normalized(), 0.2 * kOnePixelRad);
  }
  AbsolutePoseRansac::Estimate estimate;
  ASSERT_TRUE(ransac.Run(scene.bearings, scene.points, scene.tolerance, {}, rng, &estimate));
  EXPECT_LT((estimate.cam_from_world.translation - scene.truth.translation).norm(), 0.02);
}

TEST(AbsolutePoseRansac, UselessInputIsRefusedAndOutputsAreKept) {
  Rng rng(5);
  AbsolutePoseRansac ransac(100);
  const ResectionScene scene = MakeResectionScene(rng, 60, 0.0, kOnePixelRad);
  const SE3 before(Eigen::Quaterniond::Identity(), Eigen::Vector3d(7, 8, 9));
  AbsolutePoseRansac::Estimate estimate{before, -1};
  const auto expect_refused = [&](const auto& bearings, const auto& points, const auto& tolerance) {
    EXPECT_FALSE(ransac.Run(bearings, points, tolerance, {}, rng, &estimate));
    EXPECT_EQ(std::count(ransac.inliers().begin(), ransac.inliers().end(), 1), 0);
    EXPECT_EQ(estimate.cam_from_world.translation, before.translation);
    EXPECT_EQ(estimate.num_inliers, -1);
  };
  const std::vector<Eigen::Vector3d> none;
  expect_refused(none, none, std::vector<double>());
  const std::vector<Eigen::Vector3d> few_bearings(scene.bearings.begin(), scene.bearings.begin() + 9);
  const std::vector<Eigen::Vector3d> few_points(scene.points.begin(), scene.points.begin() + 9);
  expect_refused(few_bearings, few_points, std::vector<double>(9, kPixelTolerance));
  expect_refused(scene.bearings, few_points, scene.tolerance);                   // lengths differ
  const ResectionScene large = MakeResectionScene(rng, 101, 0.0, kOnePixelRad);  // over the capacity
  expect_refused(large.bearings, large.points, large.tolerance);
  // On one line, in one place, and pure chance.
  std::vector<Eigen::Vector3d> line(60), place(60, Eigen::Vector3d(0, 0, 2));
  for (int i = 0; i < 60; ++i) line[i] = Eigen::Vector3d(0.1 * i - 3.0, 0.0, 3.0);
  expect_refused(scene.bearings, line, scene.tolerance);
  expect_refused(scene.bearings, place, scene.tolerance);
  const ResectionScene chance = MakeResectionScene(rng, 100, 1.0, kOnePixelRad);
  expect_refused(chance.bearings, chance.points, chance.tolerance);
}

TEST(AbsolutePoseRansac, SameSeedGivesTheSameBits) {
  Rng scene_rng(6);
  const ResectionScene scene = MakeResectionScene(scene_rng, 200, 0.5, kOnePixelRad);
  AbsolutePoseRansac used(500), fresh(300);
  AbsolutePoseRansac::Estimate first, second;
  Rng warm_up(1), a(77), b(77);
  ASSERT_TRUE(used.Run(scene.bearings, scene.points, scene.tolerance, {}, warm_up, &first));
  ASSERT_TRUE(used.Run(scene.bearings, scene.points, scene.tolerance, {}, a, &first));
  ASSERT_TRUE(fresh.Run(scene.bearings, scene.points, scene.tolerance, {}, b, &second));
  EXPECT_EQ(first.cam_from_world.rotation.coeffs(), second.cam_from_world.rotation.coeffs());
  EXPECT_EQ(first.cam_from_world.translation, second.cam_from_world.translation);
  EXPECT_TRUE(std::equal(used.inliers().begin(), used.inliers().end(), fresh.inliers().begin()));
}

TEST(AbsolutePoseRansac, RunNeverAllocates) {
  if (!test::AllocationCounter::IsAvailable()) GTEST_SKIP() << "the sanitizer owns malloc";
  Rng rng(7);
  const ResectionScene scene = MakeResectionScene(rng, 200, 0.5, kOnePixelRad);
  AbsolutePoseRansac ransac(200);
  AbsolutePoseRansac::Estimate estimate;
  const test::AllocationCounter counter;
  const bool found = ransac.Run(scene.bearings, scene.points, scene.tolerance, {}, rng, &estimate);
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(found);
}

TEST(AllocationCounter, CountsAllocationsOfBothKinds) {
  if (!test::AllocationCounter::IsAvailable()) GTEST_SKIP() << "the sanitizer owns malloc";
  const test::AllocationCounter counter;
  auto* volatile number = new int(3);
  delete number;
  const Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(50, 50);
  EXPECT_GE(counter.count(), 2u);
  EXPECT_EQ(matrix(3, 3), 1.0);
}

}  // namespace
}  // namespace haustra
