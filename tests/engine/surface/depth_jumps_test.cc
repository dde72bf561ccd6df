// Jumps of the depth against walls that are formulas.
#include "engine/surface/depth_jumps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "tests/engine/surface/textured_scene.h"

namespace haustra {
namespace {

constexpr int kGridPx = 4;
constexpr double kLimitDeg = 5.0;

class DepthJumpsTest : public ::testing::Test {
 protected:
  // The true depth of a wall from the origin.
  DepthMap DepthOf(const Wall& wall) const {
    DepthMap map(camera_.width_px() / kGridPx, camera_.height_px() / kGridPx);
    map.Clear(0.1);
    for (int i = 0; i < map.num_cells(); ++i) {
      const double range = wall(Eigen::Vector3d::Zero(), BearingOf(map, i));
      if (range > 0.0) map.Set(i, 1.0 / range, 100);
    }
    return map;
  }
  Eigen::Vector3d BearingOf(const DepthMap& map, int cell) const {
    Eigen::Vector3d bearing;
    EXPECT_TRUE(camera_.Unproject(
        {CellCentrePx(cell % map.width(), kGridPx), CellCentrePx(cell / map.width(), kGridPx)}, &bearing));
    return bearing;
  }
  int Erase(DepthMap* map) const { return EraseJumps(camera_, kGridPx, kLimitDeg, map); }

  const CameraModel camera_ = *CameraModel::Create(SmallPinhole());
};

// At z = 1.0 where `is_near` says so of a ray, else at z = 1.4.
Wall TwoWalls(const std::function<bool(const Eigen::Vector3d&)>& is_near) {
  return [is_near](const Eigen::Vector3d&, const Eigen::Vector3d& direction) {
    return (is_near(direction) ? 1.0 : 1.4) / direction.z();
  };
}

TEST_F(DepthJumpsTest, AWallAtASlantStaysDownToTheLimit) {
  // Beside the camera and along its axis: the farther away, the more at a slant.
  DepthMap map = DepthOf(PlaneWall(Eigen::Vector3d::UnitX(), 0.2));
  int num_steep = 0, num_flat = 0;
  const DepthMap before = map;
  Erase(&map);
  for (int i = 0; i < map.num_cells(); ++i) {
    if (!before.has_depth(i)) continue;
    const double slant_deg = std::asin(BearingOf(map, i).x()) * 180.0 / std::numbers::pi;
    if (slant_deg < 0.8 * kLimitDeg) num_steep += map.has_depth(i) ? 1 : 0;
    if (slant_deg < 1.4 * kLimitDeg) continue;
    ++num_flat;
    ASSERT_TRUE(map.has_depth(i)) << slant_deg;
  }
  EXPECT_EQ(num_steep, 0);
  EXPECT_GT(num_flat, map.num_cells() / 4);
}

TEST_F(DepthJumpsTest, BothSidesOfAnEdgeGoAndNothingElse) {
  const auto is_near = [](const Eigen::Vector3d& direction) { return direction.x() < 0.0; };
  DepthMap map = DepthOf(TwoWalls(is_near));
  const DepthMap before = map;
  EXPECT_EQ(Erase(&map), 2 * map.height());
  for (int i = 0; i < map.num_cells(); ++i) {
    const int column = i % map.width();
    const bool is_beside = (column > 0 && is_near(BearingOf(map, i - 1)) != is_near(BearingOf(map, i))) ||
                           (column + 1 < map.width() && is_near(BearingOf(map, i + 1)) != is_near(BearingOf(map, i)));
    ASSERT_EQ(map.has_depth(i), !is_beside) << i;
    if (is_beside) continue;
    EXPECT_EQ(map.inverse_range(i), before.inverse_range(i));
    EXPECT_EQ(map.confidence(i), before.confidence(i));
  }
}

TEST_F(DepthJumpsTest, EachNeighbourOfALoneCellGoesWithIt) {
  DepthMap map = DepthOf(PlaneWall(Eigen::Vector3d::UnitZ(), 1.0));
  const int cell = map.height() / 2 * map.width() + map.width() / 2;
  map.Set(cell, 0.6 * map.inverse_range(cell), 100);
  EXPECT_EQ(Erase(&map), 9);
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) EXPECT_FALSE(map.has_depth(cell + v * map.width() + u));
  }
}

TEST_F(DepthJumpsTest, AGapIsNoJump) {
  DepthMap map = DepthOf(TwoWalls([](const Eigen::Vector3d& direction) { return direction.x() < 0.0; }));
  for (int y = 0; y < map.height(); ++y) map.Erase(y * map.width() + map.width() / 2);
  EXPECT_EQ(Erase(&map), 0);
  EXPECT_EQ(std::count(map.codes().begin(), map.codes().end(), DepthMap::kNoDepth), map.height());
}

}  // namespace
}  // namespace haustra
