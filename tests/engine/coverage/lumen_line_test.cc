#include "engine/coverage/lumen_line.h"

#include <gtest/gtest.h>

#include "tests/engine/coverage/bent_tube.h"

namespace haustra {
namespace {

TEST(LumenLine, HasTheLengthOfItsPointsInWholeSteps) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {0, 0, 1}, {0, 2, 1}, {0, 2, 1}};
  const LumenLine line(points, 0.4);
  EXPECT_EQ(line.num_stations(), 9);
  EXPECT_NEAR(line.length_mu(), 3.0, 1e-12);
  EXPECT_NEAR((line.station(8).position - Eigen::Vector3d(0, 2, 1)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((line.At(2.0).position - Eigen::Vector3d(0, 1, 1)).norm(), 0.0, 0.1);
}

TEST(LumenLine, BeyondTheEndsItGoesStraightOn) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {0, 0, 4}};
  const LumenLine line(points, 1.0);
  EXPECT_NEAR((line.At(-2.0).position - Eigen::Vector3d(0, 0, -2)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((line.At(7.0).position - Eigen::Vector3d(0, 0, 7)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(line.Of({1.0, 0.0, 6.0}).length_mu, 6.0, 1e-12);
}

TEST(LumenLine, CoordinatesOfAPointLeadBackToIt) {
  const BentTube tube{.radius = 1.0, .length = 8.0, .bend_radius = 3.0};
  const LumenLine line = tube.Known().line;
  for (double s = 0.3; s < 7.7; s += 0.37) {
    for (double angle = -3.0; angle < 3.1; angle += 0.7) {
      const Eigen::Vector3d point = tube.Place(s, angle, 0.9);
      const WallCoordinates at = line.Of(point);
      EXPECT_NEAR(at.length_mu, s, 0.02);
      EXPECT_NEAR(at.radius_mu, 0.9, 0.01);
      const LumenFrame frame = line.At(at.length_mu);
      const Eigen::Vector3d back = frame.position + at.radius_mu * (std::cos(at.angle_rad) * frame.normal +
                                                                    std::sin(at.angle_rad) * frame.binormal);
      EXPECT_LT((back - point).norm(), 1e-3);
      EXPECT_NEAR(line.From(point, s + 0.4).length_mu, at.length_mu, 1e-3);
    }
  }
}

TEST(LumenLine, TheFrameDoesNotTwist) {
  // A helix: the Frenet frame would turn by more than a whole turn.
  std::vector<Eigen::Vector3d> points;
  for (double t = 0.0; t < 12.0; t += 0.02) points.emplace_back(2.0 * std::cos(t), 2.0 * std::sin(t), 0.8 * t);
  const LumenLine line(points, 0.05);
  double twist = 0.0;
  for (int i = 1; i < line.num_stations(); ++i) {
    const LumenFrame &a = line.station(i - 1), &b = line.station(i);
    EXPECT_NEAR(b.normal.dot(b.tangent), 0.0, 1e-12);
    EXPECT_NEAR(b.normal.norm(), 1.0, 1e-12);
    EXPECT_NEAR((b.normal.cross(b.binormal) - b.tangent).norm(), 0.0, 1e-12);
    twist += std::abs((b.normal - a.normal).dot(0.5 * (a.binormal + b.binormal)));
  }
  EXPECT_LT(twist, 0.01);
}

}  // namespace
}  // namespace haustra
