#include "engine/coverage/wall_grid.h"

#include <gtest/gtest.h>

#include "engine/coverage/wall_coverage.h"
#include "tests/engine/coverage/bent_tube.h"

namespace haustra {
namespace {

constexpr double kGridPi = std::numbers::pi;

TEST(WallGrid, HasTheRadiusNormalAndAreaOfTheWall) {
  const BentTube tube{.radius = 2.0, .length = 10.0, .bend_radius = 8.0};
  WallGrid grid(tube.Known());
  grid.SetWall(tube.Patches(0.05), 0);
  EXPECT_NEAR(grid.step_mu(), 2.0 * kGridPi * 2.0 / WallGrid::kAngles, 0.01);
  double area = 0.0;
  for (int row = 0; row < grid.num_rows(); ++row) {
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      ASSERT_TRUE(grid.cell(row, column).is_known) << row << " " << column;
      EXPECT_NEAR(grid.cell(row, column).radius_mu, 2.0, 0.01);
      const WallPoint point = grid.PointOf(row, column);
      const WallCoordinates at = grid.lumen().line.Of(point.position_in_map);
      const Eigen::Vector3d inwards = grid.lumen().line.At(at.length_mu).position - point.position_in_map;
      EXPECT_GT(point.normal_in_map.dot(inwards.normalized()), 0.99);
      area += point.area_mu2;
    }
  }
  // By Pappus, whatever the bend.
  EXPECT_NEAR(area, 2.0 * kGridPi * 2.0 * 10.0, 1.5);
}

TEST(WallGrid, SmallHolesAreBridgedAndLargeOnesAreNot) {
  const BentTube tube{.radius = 2.0, .length = 10.0};
  WallGrid grid(tube.Known());
  // Columns 10 and 11 are missing everywhere, and 30 to 45.
  const double width = 2.0 * kGridPi / WallGrid::kAngles;
  const auto is_there = [&](double, double angle) {
    const double column = (angle < 0.0 ? angle + 2.0 * kGridPi : angle) / width;
    return !(column > 9.95 && column < 12.05) && !(column > 29.95 && column < 46.05);
  };
  // Angles of the line's own frame: that of a straight tube may begin anywhere.
  std::vector<WallPatch> patches;
  const LumenFrame frame = grid.lumen().line.station(0);
  for (double s = 0.02; s < 10.0; s += 0.05) {
    for (double angle = -kGridPi; angle < kGridPi; angle += 0.02) {
      if (!is_there(s, angle)) continue;
      patches.push_back(
          {Eigen::Vector3d(0, 0, s) + 2.0 * (std::cos(angle) * frame.normal + std::sin(angle) * frame.binormal),
           0.002});
    }
  }
  grid.SetWall(patches, 2);
  EXPECT_TRUE(grid.cell(20, 9).is_known);
  for (const int column : {10, 11}) {
    EXPECT_FALSE(grid.cell(20, column).is_known);
    EXPECT_TRUE(grid.cell(20, column).is_bridged);
    EXPECT_NEAR(grid.cell(20, column).radius_mu, 2.0, 0.01) << "filled from around";
  }
  for (int column = 30; column < 46; ++column) EXPECT_FALSE(grid.cell(20, column).is_bridged);
  grid.SetWall(patches, 1);
  EXPECT_FALSE(grid.cell(20, 10).is_bridged);
}

TEST(WallGrid, OnlyThePassedPartIsClaimed) {
  RecordProperty("req", "COV-002");
  const BentTube tube{.radius = 2.0, .length = 10.0};
  Lumen lumen = tube.Known();
  lumen.passed_begin_mu = 3.0;
  lumen.passed_end_mu = 7.0;
  const WallGrid grid(lumen);
  EXPECT_NEAR(grid.first_claimed_row() * grid.step_mu(), 3.0, grid.step_mu());
  EXPECT_NEAR(grid.end_claimed_row() * grid.step_mu(), 7.0, grid.step_mu());
}

TEST(CoverageOfSegments, SharesAreOfTheCells) {
  const BentTube tube{.radius = 2.0, .length = 12.0};
  WallGrid grid(tube.Known());
  const int half = grid.num_rows() / 2;
  for (int row = 0; row < half; ++row) {
    for (int column = 0; column < 48; ++column) {
      grid.cell(row, column).view = column < 16 ? WallView::kPoorly : WallView::kWell;
    }
  }
  const std::vector<WallCoverage> segments = CoverageOfSegments(grid, 3.0);
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_NEAR(segments[0].well, 0.5, 0.02);
  EXPECT_NEAR(segments[0].poorly, 0.25, 0.01);
  EXPECT_NEAR(segments[1].well, 0.0, 0.02);
  EXPECT_EQ(segments[0].end_row, segments[1].first_row);
  EXPECT_EQ(segments[1].end_row, grid.end_claimed_row());
  EXPECT_EQ(CoverageOfSegments(grid, 100.0).size(), 1u);
}

}  // namespace
}  // namespace haustra
