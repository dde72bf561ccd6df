#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/geometry/five_point.h"
#include "engine/geometry/p3p.h"
#include "engine/geometry/polynomial_roots.h"
#include "engine/geometry/ransac_trials.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

TEST(PolynomialRoots, AllRealRootsOfAProductOfLinearFactorsAreFound) {
  Rng rng(1);
  for (int trial = 0; trial < 300; ++trial) {
    // Ten well separated roots between -40 and 40, some within the unit interval.
    std::array<double, 10> truth;
    std::array<double, 11> coefficients{1.0};
    for (int i = 0; i < 10; ++i) {
      truth[i] = std::sinh(-4.5 + i + 0.3 * rng.Uniform());
      for (int k = i + 1; k > 0; --k) coefficients[k] = coefficients[k - 1] - truth[i] * coefficients[k];
      coefficients[0] *= -truth[i];
    }
    std::array<double, kMaxPolynomialDegree> roots;
    const int count = RealRoots(coefficients, &roots);
    ASSERT_EQ(count, 10);
    std::sort(roots.begin(), roots.end());
    for (int i = 0; i < 10; ++i) EXPECT_NEAR(roots[i], truth[i], 1e-5 * (1.0 + std::abs(truth[i])));
  }
}

TEST(PolynomialRoots, PolynomialWithoutRealRootsHasNone) {
  const std::array<double, 3> coefficients = {1.0, 0.0, 1.0};
  std::array<double, kMaxPolynomialDegree> roots;
  EXPECT_EQ(RealRoots(coefficients, &roots), 0);
  const std::array<double, 1> constant = {3.0};
  EXPECT_EQ(RealRoots(constant, &roots), 0);
}

std::vector<double> RootsOf(const std::vector<double>& coefficients) {
  std::array<double, kMaxPolynomialDegree> roots;
  const int count = RealRoots(coefficients, &roots);
  std::sort(roots.begin(), roots.begin() + count);
  return {roots.begin(), roots.begin() + count};
}

TEST(PolynomialRoots, ALineHasOneRootWhereverItLies) {
  for (const double root : {-1.0, 1.0, 0.0, 0.5, -0.5, 2.0, -1e6, std::nextafter(1.0, 0.0), std::nextafter(1.0, 2.0)}) {
    for (const double slope : {1.0, -3.0}) {
      const std::vector<double> roots = RootsOf({-slope * root, slope});
      ASSERT_EQ(roots.size(), 1u) << root;
      EXPECT_NEAR(roots[0], root, 1e-15 * std::max(1.0, std::abs(root)));
    }
  }
}

TEST(PolynomialRoots, RootsOfEvenMultiplicityAreNotReported) {
  EXPECT_TRUE(RootsOf({0.0, 0.0, 1.0}).empty());
  EXPECT_TRUE(RootsOf({1.0, -2.0, 1.0}).empty()) << "at 1";
  EXPECT_TRUE(RootsOf({1.0, 2.0, 1.0}).empty()) << "at -1";
  EXPECT_TRUE(RootsOf({4.0, 0.0, -8.0, 0.0, 4.0}).empty()) << "at 1 and -1";
  EXPECT_TRUE(RootsOf({0.0, 0.0, 0.0}).empty()) << "everywhere";
}

TEST(PolynomialRoots, RootsOfOddMultiplicityAreReportedOnce) {
  EXPECT_EQ(RootsOf({0.0, 0.0, 0.0, 1.0}), std::vector<double>{0.0});
  EXPECT_EQ(RootsOf({-1.0, 3.0, -3.0, 1.0}), std::vector<double>{1.0});
  EXPECT_EQ(RootsOf({1.0, 3.0, 3.0, 1.0}), std::vector<double>{-1.0});
  const std::vector<double> both = RootsOf({-1.0, 0.0, 1.0});
  ASSERT_EQ(both.size(), 2u);
  EXPECT_EQ(both[0], -1.0);
  EXPECT_EQ(both[1], 1.0);
  // (x + 1)^2 (x - 2), and x^2 (x - 0.25).
  const std::vector<double> beyond = RootsOf({-2.0, -3.0, 0.0, 1.0}), inside = RootsOf({0.0, 0.0, -0.25, 1.0});
  ASSERT_EQ(beyond.size(), 1u);
  EXPECT_NEAR(beyond[0], 2.0, 1e-14);
  ASSERT_EQ(inside.size(), 1u);
  EXPECT_NEAR(inside[0], 0.25, 1e-14);
}

TEST(P3P, OneOfTheSolutionsIsTheTruthInTenThousandTrials) {
  Rng rng(2);
  int solved = 0;
  constexpr int kTrials = 10000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const SE3 truth = test::RandomPose(rng, 3.1, 5.0);
    std::array<Eigen::Vector3d, 3> bearings, points;
    for (int i = 0; i < 3; ++i) {
      // Up to 85 degrees off the axis.
      Eigen::Vector3d direction;
      do {
        direction = test::RandomDirection(rng);
      } while (direction.z() < std::cos(1.48));
      bearings[i] = direction;
      points[i] = truth.Inverse() * (rng.Uniform(0.5, 8.0) * direction);
    }
    std::array<SE3, 4> poses;
    const int count = SolveP3P(bearings, points, &poses);
    double best = 1e9;
    for (int k = 0; k < count; ++k) {
      // Whatever is returned fits the three bearings.
      for (int i = 0; i < 3; ++i) EXPECT_LT(((poses[k] * points[i]).normalized() - bearings[i]).norm(), 1e-4);
      best = std::min(
          best, (poses[k].translation - truth.translation).norm() + RotationAngle(poses[k].rotation, truth.rotation));
    }
    if (best < 1e-6) ++solved;
  }
  EXPECT_GE(solved, kTrials - 20);
}

TEST(P3P, PointsOnALineOrInOnePlaceGiveNoPose) {
  const std::array<Eigen::Vector3d, 3> bearings = {Eigen::Vector3d(-0.1, 0, 1).normalized(), Eigen::Vector3d(0, 0, 1),
                                                   Eigen::Vector3d(0.1, 0, 1).normalized()};
  std::array<SE3, 4> poses;
  const std::array<Eigen::Vector3d, 3> line = {Eigen::Vector3d(-1, 0, 10), Eigen::Vector3d(0, 0, 10),
                                               Eigen::Vector3d(1, 0, 10)};
  EXPECT_EQ(SolveP3P(bearings, line, &poses), 0);
  const std::array<Eigen::Vector3d, 3> place = {line[0], line[0], line[0]};
  EXPECT_EQ(SolveP3P(bearings, place, &poses), 0);
}

// Distance of two essential matrices up to sign.
double Distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) { return std::min((a - b).norm(), (a + b).norm()); }

TEST(FivePoint, OneOfTheSolutionsIsTheTruthInTwoThousandTrials) {
  Rng rng(3);
  constexpr int kTrials = 2000;
  int solved = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const SE3 b_from_a(test::RandomRotation(rng, 0.5), test::RandomDirection(rng));
    std::array<Eigen::Vector3d, 5> a, b;
    for (int i = 0; i < 5; ++i) {
      Eigen::Vector3d point;
      do {
        point = Eigen::Vector3d(rng.Uniform(-4, 4), rng.Uniform(-4, 4), rng.Uniform(1, 8));
      } while ((b_from_a * point).norm() < 0.2);
      a[i] = point.normalized();
      b[i] = (b_from_a * point).normalized();
    }
    std::array<Eigen::Matrix3d, 10> essentials;
    const int count = SolveFivePoint(a, b, &essentials);
    const Eigen::Matrix3d truth = (Skew(b_from_a.translation) * b_from_a.matrix3()).normalized();
    double best = 1e9;
    for (int k = 0; k < count; ++k) best = std::min(best, Distance(essentials[k], truth));
    if (best < 1e-5) ++solved;
  }
  EXPECT_GE(solved, kTrials * 99 / 100);
}

TEST(FivePoint, SolutionsAreEssentialAndFitTheFivePairs) {
  Rng rng(4);
  for (int trial = 0; trial < 200; ++trial) {
    std::array<Eigen::Vector3d, 5> a, b;
    for (int i = 0; i < 5; ++i) {
      a[i] = test::NoisyBearing(rng, Eigen::Vector3d(0, 0, 1), 0.4);
      b[i] = test::NoisyBearing(rng, Eigen::Vector3d(0, 0, 1), 0.4);
    }
    std::array<Eigen::Matrix3d, 10> essentials;
    const int count = SolveFivePoint(a, b, &essentials);
    for (int k = 0; k < count; ++k) {
      const Eigen::Matrix3d& e = essentials[k];
      EXPECT_NEAR(e.norm(), 1.0, 1e-12);
      EXPECT_LT((2.0 * e * e.transpose() * e - (e * e.transpose()).trace() * e).norm(), 1e-4);
      for (int i = 0; i < 5; ++i) EXPECT_NEAR(b[i].dot(e * a[i]), 0.0, 1e-9);
    }
  }
}

TEST(FivePoint, RepeatedPairsGiveNothing) {
  const Eigen::Vector3d v = Eigen::Vector3d(0.1, 0.2, 1).normalized();
  const std::array<Eigen::Vector3d, 5> same = {v, v, v, v, v};
  std::array<Eigen::Matrix3d, 10> essentials;
  EXPECT_EQ(SolveFivePoint(same, same, &essentials), 0);
}

TEST(RansacTrials, FollowTheFormulaAndStayInBounds) {
  EXPECT_EQ(RansacTrials(100, 100, 3, 0.999, 300), 1);
  EXPECT_EQ(RansacTrials(0, 100, 3, 0.999, 300), 300);
  // log(0.01) / log(1 - 0.5^3) = 34.5
  EXPECT_EQ(RansacTrials(50, 100, 3, 0.99, 300), 35);
  EXPECT_EQ(RansacTrials(50, 100, 3, 0.99, 20), 20);
}

}  // namespace
}  // namespace haustra
