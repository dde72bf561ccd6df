// What a camera in a tube sees, against what its geometry says.
#include "engine/coverage/wall_observer.h"

#include <gtest/gtest.h>

#include <vector>

#include "engine/coverage/wall_coverage.h"
#include "tests/engine/coverage/bent_tube.h"

namespace haustra {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kSize = 400;
constexpr double kFocalPx = 200.0;  // pixels a radian: an equidistant fisheye
constexpr double kHalfAngle = 0.9;  // of the round window of the mask

CameraModel Camera() {
  CameraCalibration calibration;
  calibration.width_px = calibration.height_px = kSize;
  calibration.fx = calibration.fy = kFocalPx;
  calibration.cx = calibration.cy = 0.5 * (kSize - 1);
  return *CameraModel::Create(calibration);
}

std::vector<std::uint8_t> RoundMask() {
  std::vector<std::uint8_t> mask;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double away = std::hypot(x - 0.5 * (kSize - 1), y - 0.5 * (kSize - 1));
      mask.push_back(away <= kHalfAngle * kFocalPx ? 255 : 0);
    }
  }
  return mask;
}

// At a place of a straight tube on its axis, looking along it or back.
SE3 CamFromMap(double z, bool is_forward) {
  const Eigen::Quaterniond look(is_forward ? Eigen::AngleAxisd(0.0, Eigen::Vector3d::UnitY())
                                           : Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitY()));
  return SE3(look, {0.0, 0.0, z}).Inverse();
}

class WallObserverTest : public ::testing::Test {
 protected:
  WallObserverTest()
      : mask_(RoundMask()),
        observer_(Camera(), {mask_.data(), kSize, kSize, kSize, PixelFormat::kGrey8}, CoverageOptions()) {}

  static WallGrid GridOf(const BentTube& tube, const std::function<bool(double, double)>& is_there = {}) {
    WallGrid grid(tube.Known());
    grid.SetWall(tube.Patches(0.05, is_there), 0);
    return grid;
  }
  // Cells of the row by how they were seen; all columns must agree.
  static WallView ViewOfRow(const WallGrid& grid, double length) {
    const int row = static_cast<int>(length / grid.step_mu());
    for (int column = 1; column < WallGrid::kAngles; ++column) {
      EXPECT_EQ(grid.cell(row, column).view, grid.cell(row, 0).view) << "row at " << length << ", column " << column;
    }
    return grid.cell(row, 0).view;
  }

  std::vector<std::uint8_t> mask_;
  WallObserver observer_;
};

TEST_F(WallObserverTest, AStraightTubeIsSeenFromTheEdgeOfThePictureToTheLimits) {
  const BentTube tube{.radius = 1.0, .length = 14.0};
  WallGrid grid = GridOf(tube);
  observer_.Observe(CamFromMap(2.0, true), 5.0, &grid);
  // Ahead by d the wall lies at atan(1 / d) off the axis, at sqrt(1 + d^2), with a slant of atan(d).
  const double edge = 1.0 / std::tan(kHalfAngle), slant = std::tan(70.0 * kPi / 180.0), far = std::sqrt(35.0);
  const double margin = 0.12;  // more than a cell
  EXPECT_EQ(ViewOfRow(grid, 1.0), WallView::kNever) << "behind";
  EXPECT_EQ(ViewOfRow(grid, 2.0 + edge - margin), WallView::kNever) << "outside of the window";
  EXPECT_EQ(ViewOfRow(grid, 2.0 + edge + margin), WallView::kWell);
  EXPECT_EQ(ViewOfRow(grid, 2.0 + slant - margin), WallView::kWell);
  EXPECT_EQ(ViewOfRow(grid, 2.0 + slant + margin), WallView::kPoorly) << "too much at a slant";
  EXPECT_EQ(ViewOfRow(grid, 2.0 + far - margin), WallView::kPoorly);
  EXPECT_EQ(ViewOfRow(grid, 2.0 + far + margin), WallView::kNever) << "too far to be seen at all";
  // All of it: the share of the wall.
  const double rows = grid.end_claimed_row() - grid.first_claimed_row();
  const WallCoverage coverage = CoverageOf(grid, grid.first_claimed_row(), grid.end_claimed_row());
  EXPECT_NEAR(coverage.well, (slant - edge) / 14.0, 2.0 / rows);
  EXPECT_NEAR(coverage.poorly, (far - slant) / 14.0, 2.0 / rows);
}

TEST_F(WallObserverTest, AFoldHidesAStripUntilTheScopeLooksBack) {
  RecordProperty("req", "COV-001");
  BentTube tube{.radius = 1.0, .length = 10.0};
  const double fold = 4.0, crest = 0.6;
  tube.wall = [&](double s, double) {
    const double x = (s - fold) / 0.15;
    return 1.0 - (1.0 - crest) * std::exp(-x * x);
  };
  WallGrid grid = GridOf(tube);
  observer_.Observe(CamFromMap(2.5, true), 1.0, &grid);
  // From 1.5 before the crest the line of sight over it meets the wall 1.5 / 0.6 ahead.
  const double shadow_end = 2.5 + 1.5 / crest;
  EXPECT_NE(ViewOfRow(grid, 3.7), WallView::kNever);
  for (double s = 4.2; s < shadow_end - 0.15; s += 0.1) EXPECT_EQ(ViewOfRow(grid, s), WallView::kNever) << s;
  EXPECT_NE(ViewOfRow(grid, shadow_end + 0.25), WallView::kNever);
  // On the way out the same strip is seen from behind.
  observer_.Observe(CamFromMap(6.5, false), 9.0, &grid);
  for (double s = 4.4; s < shadow_end - 0.15; s += 0.1) EXPECT_EQ(ViewOfRow(grid, s), WallView::kWell) << s;
}

TEST_F(WallObserverTest, TimesAreThoseOfTheBestView) {
  const BentTube tube{.radius = 1.0, .length = 14.0};
  WallGrid grid = GridOf(tube);
  const int row = static_cast<int>(7.0 / grid.step_mu());
  observer_.Observe(CamFromMap(2.0, true), 1.0, &grid);
  EXPECT_EQ(grid.cell(row, 3).view, WallView::kPoorly);
  EXPECT_EQ(grid.cell(row, 3).first_s, 1.0);
  observer_.Observe(CamFromMap(5.5, true), 2.0, &grid);
  observer_.Observe(CamFromMap(6.0, true), 3.0, &grid);
  observer_.Observe(CamFromMap(2.0, true), 4.0, &grid);
  EXPECT_EQ(grid.cell(row, 3).view, WallView::kWell);
  EXPECT_EQ(grid.cell(row, 3).first_s, 2.0);
  EXPECT_EQ(grid.cell(row, 3).last_s, 3.0) << "the fourth look was from too far";
}

TEST_F(WallObserverTest, AWallThatWasNotReconstructedIsNeverSeen) {
  RecordProperty("req", "COV-001");
  const BentTube tube{.radius = 1.0, .length = 10.0};
  WallGrid grid = GridOf(tube, [](double s, double) { return s < 4.0 || s > 5.0; });
  observer_.Observe(CamFromMap(2.0, true), 1.0, &grid);
  EXPECT_EQ(ViewOfRow(grid, 3.8), WallView::kWell);
  EXPECT_EQ(ViewOfRow(grid, 4.4), WallView::kNever);
  EXPECT_NE(ViewOfRow(grid, 5.3), WallView::kNever);
}

TEST_F(WallObserverTest, WithoutAMaskTheWholePictureCounts) {
  const BentTube tube{.radius = 1.0, .length = 10.0};
  WallGrid grid = GridOf(tube);
  const WallObserver all(Camera(), {}, CoverageOptions());
  all.Observe(CamFromMap(2.0, true), 1.0, &grid);
  // The corners of the picture reach farther than its round window.
  const int row = static_cast<int>((2.0 + 1.0 / std::tan(kHalfAngle) - 0.15) / grid.step_mu());
  int seen = 0;
  for (int column = 0; column < WallGrid::kAngles; ++column) {
    seen += grid.cell(row, column).view == WallView::kWell ? 1 : 0;
  }
  EXPECT_GT(seen, 0);
}

TEST(CoverageOptions, RangesAreChecked) {
  EXPECT_TRUE(CoverageOptions().Validate().ok());
  for (CoverageOptions options : {CoverageOptions{.max_range_radii = 0.0}, CoverageOptions{.max_slant_deg = 90.0},
                                  CoverageOptions{.far_radii = 2.0}, CoverageOptions{.segment_radii = 0.0},
                                  CoverageOptions{.max_hole_cells = -1}}) {
    EXPECT_EQ(options.Validate().code(), StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace haustra
