#include "engine/coverage/path_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/coverage/lumen_line.h"
#include "tests/engine/coverage/bent_tube.h"

namespace haustra {
namespace {

double LengthOf(const std::vector<Eigen::Vector3d>& curve) {
  double length = 0.0;
  for (std::size_t i = 1; i < curve.size(); ++i) length += (curve[i] - curve[i - 1]).norm();
  return length;
}

TEST(CurveThroughPath, PassesEachPlaceOnceWhenTheScopeGoesBackAndForth) {
  const BentTube tube{.radius = 1.0, .length = 10.0, .bend_radius = 4.0};
  std::vector<Eigen::Vector3d> path;
  for (const auto& [begin, end] : {std::pair(0.0, 6.0), std::pair(3.0, 9.0), std::pair(1.0, 5.0)}) {
    for (const Eigen::Vector3d& position : tube.InAndOut(begin, end, 0.2)) path.push_back(position);
  }
  const std::vector<Eigen::Vector3d> curve = CurveThroughPath(path, 1.0);
  ASSERT_GT(curve.size(), 10u);
  EXPECT_NEAR(LengthOf(curve), 9.0, 1.2);
  EXPECT_LT((curve.front() - tube.At(0.0).position).norm(), 0.6) << "where the scope was first";
  EXPECT_LT((curve.back() - tube.At(9.0).position).norm(), 0.6);
  const LumenLine middle = tube.Known().line;
  double last = -1.0;
  for (const Eigen::Vector3d& place : curve) {
    const double at = middle.Of(place).length_mu;
    EXPECT_GT(at, last - 0.05);
    last = at;
  }
}

TEST(CurveThroughPath, EndsWhereTheScopeJumped) {
  std::vector<Eigen::Vector3d> path;
  for (int i = 0; i < 60; ++i) path.emplace_back(0.0, 0.0, 0.1 * i);
  for (int i = 0; i < 30; ++i) path.emplace_back(40.0, 0.0, 0.1 * i);
  EXPECT_NEAR(LengthOf(CurveThroughPath(path, 1.0)), 5.9, 0.3);
  // A shorter jump is a way: the scope slipped.
  for (std::size_t i = 60; i < path.size(); ++i) path[i] += Eigen::Vector3d(-40.0, 0.0, 8.0);
  EXPECT_NEAR(LengthOf(CurveThroughPath(path, 1.0)), 10.9, 0.4);
}

TEST(CurveThroughPath, OnePlaceIsNoCurve) {
  EXPECT_TRUE(CurveThroughPath({}, 1.0).empty());
  const std::vector<Eigen::Vector3d> still(50, Eigen::Vector3d(0.05, 0.05, 0.05));
  EXPECT_TRUE(CurveThroughPath(still, 1.0).empty());
}

// A map has no size that a pose might not exceed.
TEST(CurveThroughPath, FarAwayIsAPlaceLikeAnyOther) {
  for (const double far : {0.0, 1e3, 1e9, -1e9, 1e12}) {
    std::vector<Eigen::Vector3d> path;
    for (int i = 0; i < 60; ++i) path.push_back(Eigen::Vector3d(far, -far, far) + 0.1 * i * Eigen::Vector3d::UnitX());
    EXPECT_NEAR(LengthOf(CurveThroughPath(path, 1.0)), 5.9, 0.3) << far;
  }
}

TEST(CurveThroughPath, APoseAtInfinityOrNowhereIsPassedOver) {
  constexpr double kInf = std::numeric_limits<double>::infinity(), kMax = std::numeric_limits<double>::max();
  for (const double wild : {kInf, -kInf, std::numeric_limits<double>::quiet_NaN(), kMax, -kMax, 1e300}) {
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3d nowhere = Eigen::Vector3d::Zero();
      nowhere[axis] = wild;
      for (const double way : {1.0, -1.0}) {
        std::vector<Eigen::Vector3d> path;
        for (int i = 0; i < 60; ++i) path.emplace_back(0.0, 0.0, 0.1 * way * i);
        path.insert(path.begin() + 30, 2, nowhere);
        if (!std::isfinite(wild)) path.insert(path.begin(), nowhere);
        path.push_back(nowhere);
        const std::vector<Eigen::Vector3d> curve = CurveThroughPath(path, 1.0);
        ASSERT_GE(curve.size(), 2u) << wild << " " << axis;
        EXPECT_NEAR(LengthOf(curve), 5.9, 0.3) << wild << " " << axis;
        EXPECT_LT(curve.front().norm(), 0.3) << wild << " " << axis << ": where the scope was first";
      }
    }
    EXPECT_TRUE(CurveThroughPath(std::vector<Eigen::Vector3d>(20, Eigen::Vector3d::Constant(wild)), 1.0).empty());
  }
}

TEST(SmoothCurve, KeepsItsEndsAndALine) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 30; ++i) points.emplace_back(0.0, i % 2 == 0 ? 0.1 : -0.1, 0.2 * i);
  points.front().y() = points.back().y() = 0.0;
  const std::vector<Eigen::Vector3d> smooth = SmoothCurve(points, 0.6);
  EXPECT_NEAR((smooth.front() - points.front()).norm(), 0.0, 1e-9);
  EXPECT_NEAR((smooth.back() - points.back()).norm(), 0.0, 1e-9);
  for (const Eigen::Vector3d& point : smooth) EXPECT_LT(std::abs(point.y()), 0.03);
}

}  // namespace
}  // namespace haustra
