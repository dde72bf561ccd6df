#include "engine/calibration/intrinsics.h"

#include <gtest/gtest.h>

#include "engine/camera/camera_model.h"
#include "engine/geometry/rng.h"
#include "tests/geometry/synthetic.h"

namespace haustra::calibration {
namespace {

constexpr Intrinsics kScope = {398.0, 364.0, 266.0, -0.045, 0.006};

Eigen::Vector3d PointInView(Rng& rng) {
  return {rng.Uniform(-2.0, 2.0), rng.Uniform(-2.0, 2.0), rng.Uniform(0.2, 5.0)};
}

TEST(Intrinsics, ProjectsAsTheCameraModelDoes) {
  const CameraModel camera = CameraModel::Create(kScope.ToCalibration(720, 540, 25.0)).value();
  Rng rng(1);
  int num_seen = 0;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point = PointInView(rng);
    Eigen::Vector2d expected, pixel;
    if (!camera.Project(point, &expected)) continue;
    ASSERT_TRUE(kScope.Project(point, &pixel, nullptr, nullptr));
    EXPECT_LT((pixel - expected).norm(), 1e-9);
    ++num_seen;
  }
  EXPECT_GT(num_seen, 50);
}

TEST(Intrinsics, UnprojectionUndoesProjection) {
  Rng rng(2);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point = PointInView(rng);
    Eigen::Vector2d pixel;
    ASSERT_TRUE(kScope.Project(point, &pixel, nullptr, nullptr));
    Eigen::Vector3d bearing;
    ASSERT_TRUE(kScope.Unproject(pixel, &bearing));
    EXPECT_LT((bearing - point.normalized()).norm(), 1e-9);
  }
}

TEST(Intrinsics, DerivativesAreThoseOfDifferences) {
  Rng rng(3);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d point = PointInView(rng);
    Eigen::Vector2d pixel, other;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, kNumIntrinsics> by_intrinsics;
    ASSERT_TRUE(kScope.Project(point, &pixel, &by_point, &by_intrinsics));
    constexpr double kStep = 1e-6;
    for (int k = 0; k < 3; ++k) {
      ASSERT_TRUE(kScope.Project(point + kStep * Eigen::Vector3d::Unit(k), &other, nullptr, nullptr));
      EXPECT_LT(((other - pixel) / kStep - by_point.col(k)).norm(), 1e-2);
    }
    for (int k = 0; k < kNumIntrinsics; ++k) {
      ASSERT_TRUE(kScope.Plus(kStep * IntrinsicVector::Unit(k)).Project(point, &other, nullptr, nullptr));
      EXPECT_LT(((other - pixel) / kStep - by_intrinsics.col(k)).norm(), 1e-2);
    }
  }
}

TEST(Intrinsics, EndWhereTheRadiusStopsGrowing) {
  const Intrinsics folding = {100.0, 0.0, 0.0, -0.5, 0.0};
  EXPECT_NEAR(folding.MaxAngle(), std::sqrt(1.0 / 1.5), 1e-12);
  Eigen::Vector2d pixel;
  Eigen::Vector3d bearing;
  EXPECT_FALSE(folding.Project({std::sin(0.9), 0.0, std::cos(0.9)}, &pixel, nullptr, nullptr));
  EXPECT_FALSE(folding.Unproject({90.0, 0.0}, &bearing));
  EXPECT_FALSE(folding.Project(Eigen::Vector3d::Zero(), &pixel, nullptr, nullptr));
}

}  // namespace
}  // namespace haustra::calibration
