// The parts around the matcher: stored depth, seeds, choice of sources, agreement of keyframes.
#include <gtest/gtest.h>

#include "engine/geometry/rng.h"
#include "engine/surface/depth_consistency.h"
#include "engine/surface/depth_seeds.h"
#include "engine/surface/view_selection.h"
#include "tests/engine/surface/textured_scene.h"

namespace haustra {
namespace {

TEST(DepthMap, KeepsRangesToTheStepThatItStates) {
  DepthMap map(4, 1);
  map.Clear(0.5);
  map.Set(0, 1.0 / 0.5, 200);
  map.Set(1, 1.0 / 10.0, 300);
  map.Set(2, 1.0 / 0.4, 100);  // nearer than what has a code
  map.Set(3, 1e-9, 100);
  EXPECT_NEAR(map.range_mu(0), 0.5, 0.5 / 65535);
  EXPECT_NEAR(map.range_mu(1), 10.0, 10.0 * 10.0 / (65535 * 0.5));
  EXPECT_EQ(map.confidence(1), 255);
  EXPECT_FALSE(map.has_depth(2));
  EXPECT_FALSE(map.has_depth(3));
  map.Erase(0);
  EXPECT_FALSE(map.has_depth(0));
  EXPECT_EQ(map.confidence(0), 0);
}

TEST(PlaneFromSeeds, ContinuesASlantedPlaneAndBearsAWrongSeed) {
  const CameraModel camera = *CameraModel::Create(SmallPinhole());
  const Wall wall = PlaneWall(Eigen::Vector3d(0.6, -0.3, 1.0).normalized(), 2.0);
  const auto bearing_at = [&](double x, double y) {
    Eigen::Vector3d bearing;
    EXPECT_TRUE(camera.Unproject({CellCentrePx(0, kStep) + kStep * x, CellCentrePx(0, kStep) + kStep * y}, &bearing));
    return bearing;
  };
  std::vector<DepthSeed> seeds;
  for (int y = 2; y < 40; y += 6) {
    for (int x = 2; x < 50; x += 6) {
      const Eigen::Vector3d bearing = bearing_at(x, y);
      seeds.push_back({Eigen::Vector2d(x, y), bearing, 1.0 / wall(Eigen::Vector3d::Zero(), bearing)});
    }
  }
  const Eigen::Vector3d bearing = bearing_at(23, 17);
  const double truth = 1.0 / wall(Eigen::Vector3d::Zero(), bearing);
  EXPECT_NEAR(PlaneFromSeeds(seeds, {23, 17}, bearing).dot(bearing) / truth, 1.0, 0.003);
  // As far off as a point on the next fold.
  for (DepthSeed& seed : seeds) {
    if (seed.cell == Eigen::Vector2d(26, 20)) seed.inverse_range *= 0.6;
  }
  EXPECT_NEAR(PlaneFromSeeds(seeds, {23, 17}, bearing).dot(bearing) / truth, 1.0, 0.02);
}

TEST(PlaneFromSeeds, OneSeedGivesItsRange) {
  const std::vector<DepthSeed> seeds{{Eigen::Vector2d(5, 5), Eigen::Vector3d::UnitZ(), 0.5}};
  EXPECT_NEAR(PlaneFromSeeds(seeds, {6, 5}, Eigen::Vector3d::UnitZ()).z(), 0.5, 1e-9);
}

TEST(SeedGrid, FindsWhatALookAtAllSeedsFinds) {
  Rng rng(11);
  SeedGrid grid(53, 40);
  for (const int num_seeds : {0, 1, 5, 12, 13, 60, 700}) {
    std::vector<DepthSeed> seeds;
    for (int i = 0; i < num_seeds; ++i) {
      // Some beyond the border, many at the same places.
      DepthSeed seed;
      seed.cell = {std::round(rng.Uniform(-4.0, 57.0)), std::round(rng.Uniform(-4.0, i % 3 == 0 ? 44.0 : 9.0))};
      seed.inverse_range = i;
      seeds.push_back(seed);
    }
    grid.Take(seeds);
    for (int trial = 0; trial < 300; ++trial) {
      const Eigen::Vector2d cell(std::floor(rng.Uniform(0.0, 53.0)), std::floor(rng.Uniform(0.0, 40.0)));
      std::vector<DepthSeed> all = seeds;
      std::stable_sort(all.begin(), all.end(), [&](const DepthSeed& a, const DepthSeed& b) {
        return (a.cell - cell).squaredNorm() < (b.cell - cell).squaredNorm();
      });
      const std::span<const DepthSeed> found = grid.FindNearest(cell);
      ASSERT_EQ(found.size(), std::min(all.size(), kNearestSeeds));
      for (std::size_t i = 0; i < found.size(); ++i) {
        ASSERT_EQ(found[i].inverse_range, all[i].inverse_range) << num_seeds << " seeds, " << i;
      }
    }
  }
}

TEST(SelectSources, PrefersUsefulAnglesAndIsStable) {
  // Points at a distance of one; views so many degrees aside.
  const auto view = [](double degrees, int num_points) {
    SeeingView made;
    made.centre_in_map = Eigen::Vector3d(std::tan(degrees * M_PI / 180.0), 0, 0);
    for (int i = 0; i < num_points; ++i) made.points.push_back({i, Eigen::Vector3d(0, 0.001 * i, 1)});
    return made;
  };
  const std::vector<SeeingView> views{view(0, 100),  view(0.5, 100), view(8, 100), view(8, 100),
                                      view(40, 100), view(12, 100),  view(8, 5)};
  EXPECT_EQ(SelectSources(views, 0, 6, 10.0), (std::vector<int>{2, 3, 5}));
  EXPECT_EQ(SelectSources(views, 0, 2, 10.0), (std::vector<int>{2, 3}));
  EXPECT_TRUE(SelectSources(views, 0, 6, 1000.0).empty());
}

class CheckDepthTest : public ::testing::Test {
 protected:
  static constexpr int kWidth = 50, kHeight = 40;
  DepthMap DepthOf(const Wall& wall, const SE3& cam_from_map, double factor, int confidence) const {
    DepthMap map(kWidth, kHeight);
    map.Clear(0.1);
    const SE3 map_from_cam = cam_from_map.Inverse();
    for (int i = 0; i < map.num_cells(); ++i) {
      Eigen::Vector3d bearing;
      if (!camera_.Unproject({CellCentrePx(i % kWidth, kStep), CellCentrePx(i / kWidth, kStep)}, &bearing)) continue;
      const double range = wall(map_from_cam.translation, map_from_cam.rotation * bearing);
      if (range > 0.0) map.Set(i, 1.0 / (factor * range), confidence);
    }
    return map;
  }
  CameraModel camera_ = *CameraModel::Create(SmallFisheye());
  Wall wall_ = SphereWall(Eigen::Vector3d(0, 0, 0.2), 1.4);
  SE3 other_pose_{Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.2, 0, 0)};
};

TEST_F(CheckDepthTest, KeepsWhatAnotherKeyframeSeesAndMeetsInTheMiddle) {
  const DepthMap own = DepthOf(wall_, SE3(), 1.0, 200), other = DepthOf(wall_, other_pose_, 1.02, 200);
  DepthMap checked(kWidth, kHeight);
  const std::vector<PosedDepth> others{{&other, other_pose_}};
  EXPECT_GT(CheckDepth(camera_, kStep, {&own, SE3()}, others, {}, &checked), kWidth * kHeight * 8 / 10);
  const int middle = kHeight / 2 * kWidth + kWidth / 2;
  EXPECT_NEAR(checked.range_mu(middle) / own.range_mu(middle), 1.01, 0.002);
}

TEST_F(CheckDepthTest, DropsWhatTheOthersDeny) {
  const DepthMap own = DepthOf(wall_, SE3(), 1.0, 200), other = DepthOf(wall_, other_pose_, 1.1, 200);
  const DepthMap unsure = DepthOf(wall_, other_pose_, 1.0, 0);
  DepthMap checked(kWidth, kHeight);
  EXPECT_EQ(CheckDepth(camera_, kStep, {&own, SE3()}, std::vector<PosedDepth>{{&other, other_pose_}}, {}, &checked), 0);
  EXPECT_EQ(CheckDepth(camera_, kStep, {&own, SE3()}, std::vector<PosedDepth>{{&unsure, other_pose_}}, {}, &checked),
            0);
  EXPECT_EQ(CheckDepth(camera_, kStep, {&own, SE3()}, {}, {}, &checked), 0);
}

}  // namespace
}  // namespace haustra
