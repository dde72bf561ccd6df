// The centre line of tubes whose middle is known, and what is no lumen.
#include "engine/coverage/lumen_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "engine/geometry/rng.h"
#include "tests/engine/coverage/bent_tube.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

// Largest distance of the passed part of the line from the tube's middle.
double WorstOffset(const Lumen& lumen, const BentTube& tube) {
  const LumenLine middle = tube.Known().line;
  double worst = 0.0;
  for (double s = lumen.passed_begin_mu; s <= lumen.passed_end_mu; s += 0.1) {
    worst = std::max(worst, middle.Of(lumen.line.At(s).position).radius_mu);
  }
  return worst;
}

TEST(FindLumen, TheLineLiesInTheMiddleThoughThePathDoesNot) {
  const BentTube tube{.radius = 2.0, .length = 24.0, .bend_radius = 9.0};
  const Result<Lumen> lumen = FindLumen(tube.InAndOut(4.0, 20.0, 0.9), tube.Points(0.2));
  ASSERT_TRUE(lumen.ok()) << lumen.status().ToString();
  EXPECT_LT(WorstOffset(*lumen, tube), 0.05 * tube.radius);
  EXPECT_NEAR(lumen->radius_mu, tube.radius, 0.03 * tube.radius);
  EXPECT_NEAR(lumen->passed_end_mu - lumen->passed_begin_mu, 16.0, 0.8);
  EXPECT_GT(lumen->wall_share, 0.95);
  // It goes on beyond the path.
  EXPECT_GT(lumen->line.length_mu() - lumen->passed_end_mu, 1.0);
}

// The scope slides along the wall, nearer to it than a fifth of the radius.
TEST(FindLumen, AScopeThatSlidesAlongTheWallHasTheSameLumen) {
  const BentTube tube{.radius = 2.0, .length = 24.0, .bend_radius = 9.0};
  for (const double off : {1.6, 1.9}) {
    for (const double turn : {0.0, 0.05}) {
      std::vector<Eigen::Vector3d> path;
      for (int i = 0; i <= 200; ++i) path.push_back(tube.Place(4.0 + 0.08 * i, 1.0 + turn * i, off));
      const Result<Lumen> lumen = FindLumen(path, tube.Points(0.2));
      ASSERT_TRUE(lumen.ok()) << off << " " << turn << ": " << lumen.status().ToString();
      EXPECT_LT(WorstOffset(*lumen, tube), 0.05 * tube.radius) << off << " " << turn;
      EXPECT_NEAR(lumen->radius_mu, tube.radius, 0.03 * tube.radius) << off << " " << turn;
    }
  }
}

// It was never within the circle of what it went past.
TEST(FindLumen, ARodThatTheScopePassedIsNone) {
  const BentTube rod{.radius = 3.0, .length = 24.0};
  for (const double away : {0.5, 1.0, 2.0}) {
    std::vector<Eigen::Vector3d> path;
    for (int i = 0; i < 200; ++i) path.push_back(rod.Place(3.0 + 0.09 * i, 0.3, rod.radius + away));
    EXPECT_EQ(FindLumen(path, rod.Points(0.2)).code(), StatusCode::kNotFound) << away;
  }
}

TEST(FindLumen, WhatIsNotFiniteIsPassedOver) {
  const BentTube tube{.radius = 2.0, .length = 24.0, .bend_radius = 9.0};
  std::vector<Eigen::Vector3d> path = tube.InAndOut(4.0, 20.0, 0.9), wall = tube.Points(0.2);
  const Result<Lumen> without = FindLumen(path, wall);
  for (const double wild : {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    path.insert(path.begin(), Eigen::Vector3d(0.0, wild, 0.0));
    wall.insert(wall.end(), 500, Eigen::Vector3d(wild, 0.0, wild));
  }
  const Result<Lumen> lumen = FindLumen(path, wall);
  ASSERT_TRUE(lumen.ok()) << lumen.status().ToString();
  EXPECT_EQ(lumen->radius_mu, without->radius_mu);
  EXPECT_EQ(lumen->passed_begin_mu, without->passed_begin_mu);
}

TEST(FindLumen, FoldsNoiseAndWrongPointsDoNotMoveIt) {
  BentTube tube{.radius = 2.0, .length = 24.0, .bend_radius = 12.0};
  tube.wall = [](double s, double angle) {
    const double x = std::remainder(s + 0.3 * std::cos(angle), 1.6) / 0.25;
    return 2.0 - 0.8 * std::exp(-x * x);
  };
  std::vector<Eigen::Vector3d> wall = tube.Points(0.15);
  Rng rng(3, 1);
  for (Eigen::Vector3d& point : wall) {
    for (int k = 0; k < 3; ++k) point[k] += rng.Uniform(-0.1, 0.1);
  }
  for (int i = 0; i < 400; ++i) {
    wall.push_back(tube.Place(rng.Uniform(0.0, 24.0), rng.Uniform(-3.1, 3.1), rng.Uniform(0.3, 4.0)));
  }
  const Result<Lumen> lumen = FindLumen(tube.InAndOut(3.0, 21.0, 0.5), wall);
  ASSERT_TRUE(lumen.ok()) << lumen.status().ToString();
  EXPECT_LT(WorstOffset(*lumen, tube), 0.1 * tube.radius);
}

TEST(FindLumen, AThirdOfTheWallMayBeMissing) {
  const BentTube tube{.radius = 2.0, .length = 20.0, .bend_radius = 15.0};
  const auto is_there = [](double, double angle) { return std::abs(angle) < 2.1; };
  const Result<Lumen> lumen = FindLumen(tube.InAndOut(3.0, 17.0, 0.5), tube.Points(0.2, is_there));
  ASSERT_TRUE(lumen.ok()) << lumen.status().ToString();
  EXPECT_LT(WorstOffset(*lumen, tube), 0.15 * tube.radius);
  EXPECT_NEAR(lumen->wall_share, 0.67, 0.1);
}

TEST(FindLumen, AFlatWallIsNone) {
  std::vector<Eigen::Vector3d> wall, path;
  for (double x = -10.0; x < 10.0; x += 0.1) {
    for (double z = -5.0; z < 20.0; z += 0.25) wall.emplace_back(x, 2.0 + 0.1 * std::sin(3.0 * x + z), z);
  }
  for (int i = 0; i < 100; ++i) path.emplace_back(0.3 * std::sin(0.1 * i), 0.0, 0.15 * i);
  const Result<Lumen> lumen = FindLumen(path, wall);
  EXPECT_EQ(lumen.code(), StatusCode::kNotFound);
  EXPECT_THAT(lumen.status().message(), HasSubstr("of the directions around the path"));
}

TEST(FindLumen, AScopeThatStayedHasNotShownOne) {
  const BentTube tube{.radius = 2.0, .length = 12.0};
  const Result<Lumen> lumen = FindLumen(tube.InAndOut(5.0, 6.0, 0.3), tube.Points(0.2));
  EXPECT_EQ(lumen.code(), StatusCode::kNotFound);
  EXPECT_THAT(lumen.status().message(), HasSubstr("the scope moved along it by 0."));
  EXPECT_THAT(FindLumen(std::vector<Eigen::Vector3d>(30, tube.At(5.0).position), tube.Points(0.2)).status().message(),
              HasSubstr("stayed in one place"));
}

TEST(FindLumen, TooLittleIsSaid) {
  const BentTube tube{.radius = 2.0, .length = 12.0};
  EXPECT_THAT(FindLumen(tube.InAndOut(2.0, 9.0, 0.3), {}).status().message(), HasSubstr("only 0 points of the wall"));
  EXPECT_THAT(FindLumen({}, tube.Points(0.2)).status().message(), HasSubstr("only 0 frames have a pose"));
}

}  // namespace
}  // namespace haustra
