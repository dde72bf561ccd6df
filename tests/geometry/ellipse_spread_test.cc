#include "engine/geometry/ellipse_spread.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

constexpr int kWidth = 720, kHeight = 540;
constexpr double kArea = 720.0 * 540.0;

// A regular grid over a rectangle: as even as can be, no chance involved.
std::vector<Eigen::Vector2d> Grid(double x0, double x1, double y0, double y1) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 100; ++i) {
    for (int j = 0; j < 100; ++j)
      points.emplace_back(x0 + (i + 0.5) * (x1 - x0) / 100, y0 + (j + 0.5) * (y1 - y0) / 100);
  }
  return points;
}

// Points that fill an ellipse evenly.
std::vector<Eigen::Vector2d> FilledEllipse(const Eigen::Vector2d& centre, double a, double b, double angle_rad) {
  std::vector<Eigen::Vector2d> points;
  const Eigen::Rotation2Dd rotation(angle_rad);
  for (double x = -0.995; x < 1.0; x += 0.01) {
    for (double y = -0.995; y < 1.0; y += 0.01) {
      if (x * x + y * y < 1.0) points.push_back(centre + rotation * Eigen::Vector2d(a * x, b * y));
    }
  }
  return points;
}

TEST(EllipseSpread, PointsThatFillAnEllipseGiveItsArea) {
  for (const double angle : {0.0, 0.5, 1.2}) {
    const auto points = FilledEllipse({350.0, 260.0}, 200.0, 120.0, angle);
    EXPECT_NEAR(EllipseSpread(points, kWidth, kHeight), std::numbers::pi * 200.0 * 120.0 / kArea, 0.003) << angle;
  }
}

TEST(EllipseSpread, PointsAllOverTheImageCoverNearlyAllOfIt) {
  // Half axes 2 / sqrt(12) of the sides: 0.577 of a unit square; area of that ellipse inside the square, integrated.
  const double r = 2.0 / std::sqrt(12.0);
  double share = 0.0;
  for (double y = -0.4995; y < 0.5; y += 0.001) share += 0.001 * std::min(1.0, 2.0 * std::sqrt(r * r - y * y));
  EXPECT_NEAR(EllipseSpread(Grid(-0.5, 719.5, -0.5, 539.5), kWidth, kHeight), share, 0.003);
  EXPECT_NEAR(share, 0.93, 0.01);
}

TEST(EllipseSpread, HalfTheWidthAndHeightGivesAQuarterOfThat) {
  EXPECT_NEAR(EllipseSpread(Grid(179.5, 539.5, 134.5, 404.5), kWidth, kHeight), std::numbers::pi / 12.0, 0.003);
}

TEST(EllipseSpread, GaussianCloudGivesItsTwoSigmaEllipse) {
  Rng rng(1);
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 5000; ++i) {
    points.emplace_back(360.0 + 80.0 * test::Gaussian(rng), 270.0 + 60.0 * test::Gaussian(rng));
  }
  EXPECT_NEAR(EllipseSpread(points, kWidth, kHeight), 4.0 * std::numbers::pi * 80.0 * 60.0 / kArea, 0.01);
}

TEST(EllipseSpread, WhatSticksOutDoesNotCount) {
  // Centred on the left edge: half of the ellipse is outside.
  const auto points = FilledEllipse({-0.5, 269.5}, 200.0, 120.0, 0.0);
  EXPECT_NEAR(EllipseSpread(points, kWidth, kHeight), 0.5 * std::numbers::pi * 200.0 * 120.0 / kArea, 0.003);
  EXPECT_EQ(EllipseSpread(FilledEllipse({-900.0, 269.5}, 200.0, 120.0, 0.0), kWidth, kHeight), 0.0);
}

TEST(EllipseSpread, FewOrCollinearPointsCoverNothing) {
  EXPECT_EQ(EllipseSpread({}, kWidth, kHeight), 0.0);
  const std::vector<Eigen::Vector2d> two = {{0, 0}, {700, 500}};
  EXPECT_EQ(EllipseSpread(two, kWidth, kHeight), 0.0);
  const std::vector<Eigen::Vector2d> line = {{0, 0}, {100, 50}, {200, 100}, {300, 150}};
  EXPECT_EQ(EllipseSpread(line, kWidth, kHeight), 0.0);
  const std::vector<Eigen::Vector2d> place(10, Eigen::Vector2d(3, 3));
  EXPECT_EQ(EllipseSpread(place, kWidth, kHeight), 0.0);
}

}  // namespace
}  // namespace haustra
