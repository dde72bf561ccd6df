// Inverse depths against the geometry that they come from.
#include "engine/mapping/surface_depth.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"
#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

TEST(InverseDepth, ExactRaysGiveTheDepthOfThePoint) {
  Rng rng(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d point = rng.Uniform(0.5, 30.0) * RandomDirection(rng);
    const Eigen::Vector3d b = rng.Uniform(0.05, 0.4) * RandomDirection(rng);
    InverseDepth depth;
    ASSERT_TRUE(MeasureInverseDepth(point.normalized(), (point - b).normalized(), b, 0.01, &depth));
    EXPECT_NEAR(depth.value * point.norm(), 1.0, 1e-9) << "trial " << trial;
  }
}

TEST(InverseDepth, RaysThatDivergeMeetBehind) {
  const Eigen::Vector3d b(0.1, 0.0, 0.0);
  InverseDepth depth;
  ASSERT_TRUE(MeasureInverseDepth({0, 0, 1}, Eigen::Vector3d(0.01, 0, 1).normalized(), b, 0.01, &depth));
  EXPECT_LT(depth.value, 0.0);
}

TEST(InverseDepth, SigmaIsThatOfRaysTurnedByTheNoise) {
  Rng rng(2);
  const Eigen::Vector3d point(0.3, -0.2, 2.0), b(0.08, 0.03, 0.0);
  const double sigma_rad = 0.004;
  double squares = 0.0, sigma = 0.0;
  const int num = 4000;
  for (int i = 0; i < num; ++i) {
    const Eigen::Vector3d noise = GaussianVector(rng, sigma_rad);
    InverseDepth depth;
    ASSERT_TRUE(
        MeasureInverseDepth(point.normalized(), ((point - b).normalized() + noise).normalized(), b, sigma_rad, &depth));
    squares += (depth.value - 1.0 / point.norm()) * (depth.value - 1.0 / point.norm());
    sigma = depth.sigma;
  }
  EXPECT_NEAR(std::sqrt(squares / num), sigma, 0.05 * sigma);
}

TEST(InverseDepth, NoBaselineAcrossTheRayMeasuresNothing) {
  InverseDepth depth;
  EXPECT_FALSE(MeasureInverseDepth({0, 0, 1}, {0, 0, 1}, {0, 0, 0.5}, 0.01, &depth));
  EXPECT_FALSE(MeasureInverseDepth({0, 0, 1}, {0, 0, 1}, {0, 0, 0}, 0.01, &depth));
}

// Why points are not chosen by the parallax that was measured: of walls at known depths, seen with a parallax of two
// sigmas, those that show three lie too near. Weighed against the wall, all of them together lie where the wall is.
TEST(InverseDepth, CombinedWithTheWallIsRightOnAverageWhereAGateIsNot) {
  Rng rng(3);
  const double wall = 2.0, spread = 0.4, sigma_rad = 0.005;
  const Eigen::Vector3d b(2.0 * sigma_rad * wall, 0.0, 0.0);
  const InverseDepth expected = {1.0 / wall, spread / wall};
  double truth = 0.0, combined = 0.0, gated = 0.0, truth_of_gated = 0.0;
  int num = 0, num_gated = 0;
  while (num < 20000) {
    const double inverse = expected.value + expected.sigma * Gaussian(rng);
    if (inverse < 0.1 * expected.value) continue;
    const Eigen::Vector3d point(0.0, 0.0, 1.0 / inverse);
    const Eigen::Vector3d ray = (point - b).normalized() + GaussianVector(rng, sigma_rad);
    InverseDepth measured;
    ASSERT_TRUE(MeasureInverseDepth({0, 0, 1}, ray.normalized(), b, sigma_rad, &measured));
    truth += inverse;
    combined += Combine(measured, expected).value;
    ++num;
    if (measured.value < 3.0 * measured.sigma) continue;
    gated += measured.value;
    truth_of_gated += inverse;
    ++num_gated;
  }
  ASSERT_GT(num_gated, 1000);
  EXPECT_NEAR(combined / truth, 1.0, 0.02);
  EXPECT_GT(gated / truth_of_gated, 1.2);
}

TEST(InverseDepth, CombinedFollowsTheMoreCertain) {
  const InverseDepth both = Combine({1.0, 0.01}, {2.0, 1.0});
  EXPECT_NEAR(both.value, 1.0, 0.001);
  EXPECT_LT(both.sigma, 0.01);
  EXPECT_DOUBLE_EQ(Combine({1.0, 0.3}, {2.0, 0.3}).value, 1.5);
}

}  // namespace
}  // namespace haustra::test
