#include "tools/evaluate/shared_view.h"

#include <gtest/gtest.h>

#include "tests/tools/evaluate/synthetic_run.h"

namespace haustra::evaluate {
namespace {

class SharedViewTest : public ::testing::Test {
 protected:
  static View At(double x, double y, double z, double turn_deg = 0.0, double depth = 30.0) {
    const Eigen::AngleAxisd turn(turn_deg * std::numbers::pi / 180.0, Eigen::Vector3d::UnitY());
    return {SE3(Eigen::Quaterniond(turn), Eigen::Vector3d(x, y, z)), depth};
  }
  SharedView shared_view_{*CameraModel::Create(WideCamera())};
};

TEST_F(SharedViewTest, FrameSharesAllOfItsViewWithItself) {
  EXPECT_DOUBLE_EQ(shared_view_.VolumeInCommon(At(0, 0, 0), At(0, 0, 0)), 1.0);
  EXPECT_TRUE(shared_view_.Holds(At(0, 0, 0), At(0, 0, 0)));
}

TEST_F(SharedViewTest, NeighbourSharesMostAndAStrangerNothing) {
  EXPECT_GT(shared_view_.VolumeInCommon(At(0, 0, 0), At(3, 0, 2)), 0.7);
  EXPECT_TRUE(shared_view_.Holds(At(0, 0, 0), At(3, 0, 2)));
  EXPECT_EQ(shared_view_.VolumeInCommon(At(0, 0, 0), At(0, 0, -200)), 0.0);
  EXPECT_FALSE(shared_view_.Holds(At(0, 0, 0), At(0, 0, -200)));
}

TEST_F(SharedViewTest, OppositeDirectionSharesNothing) {
  EXPECT_FALSE(shared_view_.Holds(At(0, 0, 0), At(0, 0, 60, 180.0)));
}

TEST_F(SharedViewTest, AnglesFrom45DegreesOnAreRefusedWhateverIsShared) {
  // Both look at the point 30 mm in front of the first.
  const auto around = [](double turn_deg) {
    const double turn = turn_deg * std::numbers::pi / 180.0;
    return At(-30 * std::sin(turn), 0, 30 - 30 * std::cos(turn), turn_deg);
  };
  EXPECT_TRUE(shared_view_.Holds(At(0, 0, 0), around(30.0)));
  EXPECT_GT(shared_view_.VolumeInCommon(At(0, 0, 0), around(46.0)), 0.2);
  EXPECT_FALSE(shared_view_.Holds(At(0, 0, 0), around(46.0)));
}

TEST_F(SharedViewTest, SmallViewInsideALargeOneIsNotShared) {
  const View wide = At(0, 0, 0, 0.0, 60.0), close = At(0, 0, 40, 0.0, 10.0);
  EXPECT_FALSE(shared_view_.Holds(wide, close));
  EXPECT_FALSE(shared_view_.Holds(close, wide));
}

TEST_F(SharedViewTest, CriterionIsSymmetric) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> offset(-20.0, 20.0), turn(-60.0, 60.0), depth(15.0, 45.0);
  int num_shared = 0;
  for (int i = 0; i < 200; ++i) {
    const View a = At(0, 0, 0, 0.0, depth(rng)), b = At(offset(rng), offset(rng), offset(rng), turn(rng), depth(rng));
    EXPECT_EQ(shared_view_.Holds(a, b), shared_view_.Holds(b, a));
    num_shared += shared_view_.Holds(a, b) ? 1 : 0;
  }
  EXPECT_GT(num_shared, 10);
  EXPECT_LT(num_shared, 190);
}

TEST_F(SharedViewTest, VolumeInCommonIsThatOfTheGeometry) {
  // Moved sideways, against a dense sampling of the volume by random points.
  const View a = At(0, 0, 0), b = At(12, 0, 0);
  const CameraModel camera = *CameraModel::Create(WideCamera());
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> box(-60.0, 60.0);
  int num_in_a = 0, num_in_both = 0;
  const auto is_in = [&](const View& view, const Eigen::Vector3d& point_in_world) {
    const Eigen::Vector3d point = view.world_from_cam.Inverse() * point_in_world;
    Eigen::Vector2d pixel;
    return point.norm() > 15.0 && point.norm() < 45.0 && camera.Project(point, &pixel) && camera.IsInImage(pixel);
  };
  for (int i = 0; i < 400000; ++i) {
    const Eigen::Vector3d point(box(rng), box(rng), box(rng));
    if (!is_in(a, point)) continue;
    ++num_in_a;
    num_in_both += is_in(b, point) ? 1 : 0;
  }
  EXPECT_NEAR(shared_view_.VolumeInCommon(a, b), static_cast<double>(num_in_both) / num_in_a, 0.05);
}

TEST_F(SharedViewTest, StandstillIsOneView) {
  std::vector<View> views(50, At(0, 0, 0));
  EXPECT_EQ(SelectViews(views), (std::vector<std::size_t>{0}));
  views.push_back(At(4, 0, 0));
  views.push_back(At(4, 0, 0, 15.0));
  EXPECT_EQ(SelectViews(views), (std::vector<std::size_t>{0, 50, 51}));
  EXPECT_TRUE(SelectViews({}).empty());
}

}  // namespace
}  // namespace haustra::evaluate
