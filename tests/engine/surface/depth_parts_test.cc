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

TEST_F(CheckDepthTest, TwoMustAgreeWhereTwoAreAsked) {
  const SE3 third_pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.2, 0, 0));
  const DepthMap own = DepthOf(wall_, SE3(), 1.0, 200), other = DepthOf(wall_, other_pose_, 1.0, 200);
  const DepthMap nearer = DepthOf(wall_, third_pose, 0.9, 200), third = DepthOf(wall_, third_pose, 1.0, 200);
  DepthMap checked(kWidth, kHeight);
  const std::vector<PosedDepth> one_denies{{&other, other_pose_}, {&nearer, third_pose}};
  EXPECT_EQ(CheckDepth(camera_, kStep, {&own, SE3()}, one_denies, {}, &checked), 0);
  const std::vector<PosedDepth> both_agree{{&other, other_pose_}, {&third, third_pose}};
  EXPECT_GT(CheckDepth(camera_, kStep, {&own, SE3()}, both_agree, {}, &checked), kWidth * kHeight * 6 / 10);
}

// A strip beside the edge of a fold that is claimed too near, by two keyframes alike: the others look past the edge.
TEST_F(CheckDepthTest, DropsWhatOthersSeeThrough) {
  const auto strip = [](int cell) { return cell % kWidth >= 20 && cell % kWidth < 26; };
  DepthMap own = DepthOf(wall_, SE3(), 1.0, 200);
  for (int i = 0; i < own.num_cells(); ++i) {
    if (strip(i) && own.has_depth(i)) own.Set(i, own.inverse_range(i) / 0.8, 200);
  }
  const DepthMap accomplice = own;  // in two keyframes
  std::vector<SE3> poses;
  std::vector<DepthMap> depths;
  for (const double x : {-0.2, -0.1, 0.1, 0.2}) {
    poses.push_back(SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0, 0)));
    depths.push_back(DepthOf(wall_, poses.back(), 1.0, 200));
  }
  std::vector<PosedDepth> others{{&accomplice, SE3()}, {&accomplice, SE3()}};
  for (std::size_t i = 0; i < depths.size(); ++i) others.push_back({&depths[i], poses[i]});
  DepthMap checked(kWidth, kHeight);
  CheckDepth(camera_, kStep, {&own, SE3()}, others, {}, &checked);
  int in_strip = 0, elsewhere = 0;
  for (int i = 0; i < checked.num_cells(); ++i) (strip(i) ? in_strip : elsewhere) += checked.has_depth(i) ? 1 : 0;
  EXPECT_EQ(in_strip, 0);
  EXPECT_GT(elsewhere, (kWidth - 6) * kHeight * 8 / 10);
}

// A plate before a wall: what others know of both is the plate where it hides the wall.
class FillDepthTest : public CheckDepthTest {
 protected:
  void SetUp() override {
    wall_ = [sphere = wall_](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
      const double distance = (0.9 - origin.z()) / direction.z();
      const Eigen::Vector3d point = origin + distance * direction;
      const bool meets_plate = distance > 0.0 && std::abs(point.x()) < 0.25 && std::abs(point.y()) < 0.3;
      return meets_plate ? distance : sphere(origin, direction);
    };
    for (const Eigen::Vector3d& centre : {Eigen::Vector3d(-0.2, 0, 0), Eigen::Vector3d(0.2, 0.05, 0),
                                          Eigen::Vector3d(0, -0.2, 0.05), Eigen::Vector3d(0.05, 0.2, 0)}) {
      poses_.push_back(SE3(Eigen::Quaterniond::Identity(), -centre));
      depths_.push_back(DepthOf(wall_, poses_.back(), 1.0, 200));
    }
    own_.Clear(0.1);
  }
  std::vector<PosedDepth> Others(std::size_t num) const {
    std::vector<PosedDepth> others;
    for (std::size_t i = 0; i < num; ++i) others.push_back({&depths_[i], poses_[i]});
    return others;
  }
  int Fill(std::size_t num_others) {
    return FillDepth(camera_, kStep, {&own_, SE3()}, Others(num_others), shows_scene_, {}, &filled_);
  }

  std::vector<SE3> poses_;
  std::vector<DepthMap> depths_;
  DepthMap own_{kWidth, kHeight}, filled_{kWidth, kHeight};
  std::vector<std::uint8_t> shows_scene_ = std::vector<std::uint8_t>(kWidth * kHeight, 1);
};

TEST_F(FillDepthTest, TakesTheNearestWallThatOthersKnow) {
  const DepthMap truth = DepthOf(wall_, SE3(), 1.0, 200);
  EXPECT_GT(Fill(4), kWidth * kHeight * 8 / 10);
  int num_off = 0, num_filled = 0;
  for (int i = 0; i < truth.num_cells(); ++i) {
    if (!filled_.has_depth(i) || !truth.has_depth(i)) continue;
    ++num_filled;
    num_off += std::abs(filled_.range_mu(i) / truth.range_mu(i) - 1.0) > 0.04 ? 1 : 0;
  }
  EXPECT_LT(num_off, num_filled / 20);  // cells that the edge of the plate divides
}

TEST_F(FillDepthTest, KeepsWhatIsKnown) {
  own_ = DepthOf(wall_, SE3(), 1.0, 90);
  for (int i = 0; i < own_.num_cells(); i += 2) own_.Erase(i);
  int num_known = 0;
  for (int i = 0; i < own_.num_cells(); ++i) num_known += own_.has_depth(i) ? 1 : 0;
  EXPECT_EQ(Fill(0), num_known);
  EXPECT_GT(Fill(3), num_known * 3 / 2);
  for (int i = 0; i < own_.num_cells(); ++i) {
    if (!own_.has_depth(i)) continue;
    ASSERT_NEAR(filled_.range_mu(i) / own_.range_mu(i), 1.0, 0.001);
    ASSERT_EQ(filled_.confidence(i), 90);
  }
}

TEST_F(FillDepthTest, LeavesOutWhatIsNotTheScene) {
  std::fill(shows_scene_.begin(), shows_scene_.begin() + kWidth * kHeight / 2, std::uint8_t{0});
  Fill(4);
  for (int i = 0; i < kWidth * kHeight / 2; ++i) ASSERT_FALSE(filled_.has_depth(i));
}

}  // namespace
}  // namespace haustra
