// The rotation between two sets of bearings, and what it leaves when the scope also moved.
#include "engine/geometry/rotation_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <random>
#include <vector>

#include "engine/geometry/se3.h"

namespace haustra {
namespace {

struct Views {
  std::vector<Eigen::Vector3d> a;
  std::vector<Eigen::Vector3d> b;
  std::vector<std::uint8_t> flags;
  std::vector<double> residual;
};

// Points two to six units before the first camera, seen from the second.
Views MakeViews(const SE3& b_from_a, int num) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> side(-1.0, 1.0);
  Views views;
  for (int i = 0; i < num; ++i) {
    const Eigen::Vector3d point(3 * side(random), 3 * side(random), 4 + 2 * side(random));
    views.a.push_back(point.normalized());
    views.b.push_back((b_from_a * point).normalized());
  }
  views.flags.assign(views.a.size(), 1);
  views.residual.resize(views.a.size());
  return views;
}

TEST(FitRotation, PureRotationIsRecoveredAndLeavesNothing) {
  const SE3 b_from_a(ExpSO3({0.2, -0.3, 0.1}), Eigen::Vector3d::Zero());
  Views views = MakeViews(b_from_a, 50);
  Eigen::Matrix3d rotation;
  ASSERT_TRUE(FitRotation(views.a, views.b, views.flags, &rotation, views.residual));
  EXPECT_LT((rotation - b_from_a.matrix3()).norm(), 1e-9);
  for (const double residual : views.residual) EXPECT_LT(residual, 1e-7);
}

TEST(FitRotation, UnflaggedPairsDoNotCount) {
  const SE3 b_from_a(ExpSO3({0.0, 0.1, 0.0}), Eigen::Vector3d::Zero());
  Views views = MakeViews(b_from_a, 40);
  for (int i = 0; i < 20; ++i) {
    views.b[i] = -views.b[i];
    views.flags[i] = 0;
  }
  Eigen::Matrix3d rotation;
  ASSERT_TRUE(FitRotation(views.a, views.b, views.flags, &rotation, views.residual));
  EXPECT_LT((rotation - b_from_a.matrix3()).norm(), 1e-9);
}

TEST(FitRotation, TranslationLeavesParallax) {
  // Forward motion of a tenth of the depth: points off the axis move outwards, which no rotation does.
  const SE3 b_from_a(ExpSO3({0.05, 0.0, 0.0}), Eigen::Vector3d(0, 0, -0.4));
  Views views = MakeViews(b_from_a, 200);
  Eigen::Matrix3d rotation;
  ASSERT_TRUE(FitRotation(views.a, views.b, views.flags, &rotation, views.residual));
  std::sort(views.residual.begin(), views.residual.end());
  EXPECT_GT(views.residual[100], 0.02);
}

TEST(FitRotation, TooFewPairsAreRefused) {
  Views views = MakeViews(SE3{}, 2);
  Eigen::Matrix3d rotation;
  EXPECT_FALSE(FitRotation(views.a, views.b, views.flags, &rotation, views.residual));
}

TEST(FitRotation, SpansOfDifferentLengthAreRefused) {
  Views views = MakeViews(SE3{}, 10);
  views.b.pop_back();
  Eigen::Matrix3d rotation;
  EXPECT_FALSE(FitRotation(views.a, views.b, views.flags, &rotation, views.residual));
}

}  // namespace
}  // namespace haustra
