#include "engine/geometry/triangulation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

TEST(Triangulation, ExactBearingsGiveTheExactPointInAnyDirection) {
  Rng rng(1);
  int tested = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const SE3 b_from_a = test::RandomPose(rng, 2.0, 1.0);
    const Eigen::Vector3d point = rng.Uniform(0.5, 10.0) * test::RandomDirection(rng);  // also behind the image plane
    const Eigen::Vector3d in_b = b_from_a * point;
    const double parallax = std::acos(std::min(1.0, (b_from_a.rotation * point).normalized().dot(in_b.normalized())));
    if (parallax < 1e-3) continue;
    ++tested;
    Triangulated result;
    ASSERT_TRUE(TriangulateBearings(b_from_a, point.normalized(), in_b.normalized(), &result));
    EXPECT_LT((result.point_in_a - point).norm(), 1e-8 * point.norm() / parallax);
    EXPECT_NEAR(std::acos(std::min(1.0, result.cos_parallax)), parallax, 1e-7);
  }
  EXPECT_GT(tested, 1500);
}

TEST(Triangulation, NoisyPointIsTheOneNearestToBothBearings) {
  Rng rng(2);
  for (int trial = 0; trial < 300; ++trial) {
    const SE3 b_from_a = SE3(test::RandomRotation(rng, 0.3), Eigen::Vector3d(1.0, 0.2, 0.1));
    const Eigen::Vector3d point(rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(2, 5));
    const Eigen::Vector3d a = test::NoisyBearing(rng, point.normalized(), 3e-3);
    const Eigen::Vector3d b = test::NoisyBearing(rng, (b_from_a * point).normalized(), 3e-3);
    Triangulated result;
    ASSERT_TRUE(TriangulateBearings(b_from_a, a, b, &result));
    const auto cost = [&](const Eigen::Vector3d& p) {
      return p.normalized().cross(a).squaredNorm() + (b_from_a * p).normalized().cross(b).squaredNorm();
    };
    const double best = cost(result.point_in_a);
    for (int i = 0; i < 30; ++i) {
      EXPECT_GE(cost(result.point_in_a + test::GaussianVector(rng, 1e-3)), best * (1 - 1e-9));
    }
  }
}

TEST(Triangulation, PointBehindACameraIsRefused) {
  const SE3 b_from_a(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-1, 0, 0));
  const Eigen::Vector3d point(0.5, 0.1, 4.0);
  const Eigen::Vector3d a = point.normalized(), b = (b_from_a * point).normalized();
  Triangulated result;
  EXPECT_TRUE(TriangulateBearings(b_from_a, a, b, &result));
  EXPECT_FALSE(TriangulateBearings(b_from_a, -a, -b, &result));  // would meet behind both
  EXPECT_FALSE(TriangulateBearings(b_from_a, -a, b, &result));
  EXPECT_FALSE(TriangulateBearings(b_from_a, a, -b, &result));
  EXPECT_FALSE(TriangulateBearings(b_from_a, b, a, &result));  // rays that part
}

TEST(Triangulation, ParallelRaysAndZeroBaselineAreRefused) {
  Triangulated result;
  const Eigen::Vector3d forward(0, 0, 1);
  const SE3 sideways(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-1, 0, 0));
  EXPECT_FALSE(TriangulateBearings(sideways, forward, forward, &result));
  const SE3 along(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -1));
  EXPECT_FALSE(TriangulateBearings(along, forward, forward, &result));  // on the epipole
  EXPECT_FALSE(TriangulateBearings(SE3(), Eigen::Vector3d(0.1, 0, 1).normalized(), forward, &result));
}

}  // namespace
}  // namespace haustra
