// Jumps of the depth against walls that are formulas.
#include "engine/surface/depth_jumps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "tests/engine/surface/textured_scene.h"

namespace haustra {
namespace {

constexpr int kGridPx = 4;

class DepthJumpsTest : public ::testing::Test {
 protected:
  void Use(const CameraCalibration& calibration) { camera_ = *CameraModel::Create(calibration); }
  DepthMap Empty() const {
    DepthMap map(camera_.width_px() / kGridPx, camera_.height_px() / kGridPx);
    map.Clear(0.1);
    return map;
  }
  // The true depth of a wall from the origin.
  DepthMap DepthOf(const Wall& wall) const {
    DepthMap map = Empty();
    for (int i = 0; i < map.num_cells(); ++i) {
      const double range = wall(Eigen::Vector3d::Zero(), BearingOf(map, i));
      if (range > 0.0) map.Set(i, 1.0 / range, 100);
    }
    return map;
  }
  // At z = 1.0 in the cells that are near, in the others at `far`.
  DepthMap TwoWalls(const std::function<bool(int, int)>& is_near, double far = 1.4) const {
    DepthMap map = Empty();
    for (int i = 0; i < map.num_cells(); ++i) {
      const double z = is_near(i % map.width(), i / map.width()) ? 1.0 : far;
      map.Set(i, BearingOf(map, i).z() / z, 100);
    }
    return map;
  }
  Eigen::Vector3d BearingOf(const DepthMap& map, int cell) const {
    Eigen::Vector3d bearing;
    EXPECT_TRUE(camera_.Unproject(
        {CellCentrePx(cell % map.width(), kGridPx), CellCentrePx(cell / map.width(), kGridPx)}, &bearing));
    return bearing;
  }
  int Erase(DepthMap* map) const { return EraseJumps(camera_, kGridPx, JumpOptions(), map); }

  CameraModel camera_ = *CameraModel::Create(SmallPinhole());
};

TEST_F(DepthJumpsTest, AWallAtASlantStaysDownToTheLimit) {
  // Beside the camera and along its axis: the farther away, the more at a slant.
  DepthMap map = DepthOf(PlaneWall(Eigen::Vector3d::UnitX(), 0.2));
  int num_steep = 0, num_flat = 0;
  const DepthMap before = map;
  Erase(&map);
  for (int i = 0; i < map.num_cells(); ++i) {
    if (!before.has_depth(i)) continue;
    const double slant_deg = std::asin(BearingOf(map, i).x()) * 180.0 / std::numbers::pi;
    if (slant_deg < 0.8 * JumpOptions().min_slant_deg) num_steep += map.has_depth(i) ? 1 : 0;
    if (slant_deg < 1.4 * JumpOptions().min_slant_deg) continue;
    ++num_flat;
    ASSERT_TRUE(map.has_depth(i)) << slant_deg;
  }
  EXPECT_EQ(num_steep, 0);
  EXPECT_GT(num_flat, map.num_cells() / 4);
}

TEST_F(DepthJumpsTest, BothSidesOfAnEdgeGoAndNothingElse) {
  const std::function<bool(int, int)> upright = [](int x, int) { return x < 25; };
  const std::function<bool(int, int)> level = [](int, int y) { return y < 20; };
  const std::function<bool(int, int)> oblique = [](int x, int y) { return x < y; };
  const std::function<bool(int, int)> other_oblique = [](int x, int y) { return x + y < 40; };
  for (const auto& is_near : {upright, level, oblique, other_oblique}) {
    DepthMap map = TwoWalls(is_near);
    const DepthMap before = map;
    EXPECT_GT(Erase(&map), 2 * map.height() - 4);
    // At the border of the picture a cell has fewer neighbours, and may jump against most of them.
    for (int y = 2; y + 2 < map.height(); ++y) {
      for (int x = 2; x + 2 < map.width(); ++x) {
        bool is_beside = false;
        for (int k = 0; k < 9; ++k) is_beside |= is_near(x + k % 3 - 1, y + k / 3 - 1) != is_near(x, y);
        const int cell = y * map.width() + x;
        ASSERT_EQ(map.has_depth(cell), !is_beside) << x << ", " << y;
        if (is_beside) continue;
        ASSERT_EQ(map.inverse_range(cell), before.inverse_range(cell));
        ASSERT_EQ(map.confidence(cell), before.confidence(cell));
      }
    }
  }
}

// A cell that jumps against all around it is wrong itself: the wall around it stays.
TEST_F(DepthJumpsTest, ALoneCellGoesAlone) {
  DepthMap map = TwoWalls([](int, int) { return true; });
  const int cell = map.height() / 2 * map.width() + map.width() / 2;
  map.Set(cell, 0.6 * map.inverse_range(cell), 100);
  EXPECT_EQ(Erase(&map), 1);
  EXPECT_FALSE(map.has_depth(cell));
}

// On a fine grid neighbours see a wall under so small an angle that its noise is steeper than any slant.
TEST_F(DepthJumpsTest, NoiseOnAFineGridIsNoJumpAndAnEdgeThereIs) {
  CameraCalibration narrow = SmallPinhole();
  narrow.fx = narrow.fy = 2000.0;
  Use(narrow);
  DepthMap noisy = TwoWalls([](int x, int y) { return (x / 2 + y / 3) % 2 == 0; }, 1.06);
  EXPECT_EQ(Erase(&noisy), 0);
  DepthMap edge = TwoWalls([](int x, int) { return x < 25; }, 1.1);
  EXPECT_EQ(Erase(&edge), 2 * edge.height());
}

TEST_F(DepthJumpsTest, APairIsComparedInEveryDirection) {
  for (const auto& [u, v] : {std::pair{1, 0}, {0, 1}, {1, 1}, {-1, 1}}) {
    for (const double far : {1.4, 1.01}) {
      const DepthMap whole = TwoWalls([](int x, int y) { return x == 20 && y == 20; }, far);
      DepthMap map = Empty();
      for (const int cell : {20 * map.width() + 20, (20 + v) * map.width() + 20 + u}) {
        map.Set(cell, whole.inverse_range(cell), 100);
      }
      EXPECT_EQ(Erase(&map), far > 1.1 ? 2 : 0) << u << ", " << v;
    }
  }
}

TEST_F(DepthJumpsTest, AGapIsNoJump) {
  DepthMap map = TwoWalls([](int x, int) { return x < 25; });
  for (int y = 0; y < map.height(); ++y) map.Erase(y * map.width() + 25);
  EXPECT_EQ(Erase(&map), 0);
  EXPECT_EQ(std::count(map.codes().begin(), map.codes().end(), DepthMap::kNoDepth), map.height());
}

}  // namespace
}  // namespace haustra
