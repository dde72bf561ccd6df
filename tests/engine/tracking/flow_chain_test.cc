#include "engine/tracking/flow_chain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/geometry/rng.h"

namespace haustra::test {
namespace {

using std::chrono::milliseconds;

constexpr MapId kMap = 3;
constexpr int kNumPoints = 200;
const TimePoint kBegin = TimePoint{} + std::chrono::seconds(10);

CameraModel Camera() {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kPinhole;
  calibration.width_px = 640;
  calibration.height_px = 480;
  calibration.fx = calibration.fy = 500.0;
  calibration.cx = 319.5;
  calibration.cy = 239.5;
  return CameraModel::Create(calibration).value();
}

SE3 Turned(double degrees, const Eigen::Vector3d& translation) {
  SE3 pose;
  pose.rotation = Eigen::AngleAxisd(degrees * M_PI / 180.0, Eigen::Vector3d::UnitY());
  pose.translation = translation;
  return pose;
}

// A wall of points before a scope at `cam_from_map_`, all of them features of one frame.
class FlowChainTest : public ::testing::Test {
 protected:
  FlowChainTest() : chain_(camera_, kNumPoints), last_(kNumPoints, std::pmr::get_default_resource()) {
    Rng rng(7, 1);
    for (int i = 0; i < kNumPoints; ++i) {
      points_.emplace_back(rng.Uniform(-1.5, 1.5), rng.Uniform(-1.0, 1.0), rng.Uniform(4.0, 7.0));
    }
  }

  FollowedPoint See(const Eigen::Vector3d& point, const SE3& now_from_anchor) const {
    Eigen::Vector2d pixel;
    if (!camera_.Project(now_from_anchor * point, &pixel)) return {};
    return {static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), true, true};
  }

  // The first `num_of_map` features show map points.
  void Anchor(int num_of_map) {
    last_.features.num = kNumPoints;
    last_.matches.clear();
    for (int i = 0; i < kNumPoints; ++i) {
      const FollowedPoint seen = See(points_[i], SE3{});
      last_.features.keypoints[i] = {seen.x_px, seen.y_px, 2.0f, 0.0f, 0.1f, 0};
      const Eigen::Vector3f bearing = points_[i].normalized().cast<float>();
      last_.features.bearings[i] = {bearing.x(), bearing.y(), bearing.z()};
      if (i < num_of_map) last_.matches.emplace_back(i, MapPointHandle{});
    }
    chain_.Begin(last_, kMap, cam_from_map_, kBegin);
  }

  // The scope moves, and from point `first_moving` on something before the wall goes its own way.
  void Move(const SE3& now_from_anchor, int first_moving, int num_left = kNumPoints) {
    std::vector<FollowedPoint> to;
    for (int i = 0; i < kNumPoints; ++i) {
      const Eigen::Vector3d offset = i < first_moving ? Eigen::Vector3d::Zero() : Eigen::Vector3d(0.6, 0.5, 0.0);
      to.push_back(i < num_left ? See(points_[i] + offset, now_from_anchor) : FollowedPoint{});
    }
    chain_.Advance(to);
  }

  bool Denies(const SE3& now_from_anchor, milliseconds age = milliseconds(200), MapId map_id = kMap) const {
    return chain_.Judge(map_id, now_from_anchor * cam_from_map_, kBegin + age).denies;
  }

  const CameraModel camera_ = Camera();
  const SE3 cam_from_map_ = Turned(30.0, {1.0, -2.0, 0.5});
  const SE3 motion_ = Turned(4.0, {0.3, 0.1, 0.2});
  const SE3 false_motion_ = Turned(-3.0, {-0.4, 0.6, 0.1});
  FlowChain chain_;
  LastFrame last_;
  std::vector<Eigen::Vector3d> points_;
};

TEST_F(FlowChainTest, DeniesAPoseThatMovesThePictureInAnotherWay) {
  for (const int num_of_map : {0, 100}) {
    Anchor(num_of_map);
    Move(motion_, kNumPoints);
    EXPECT_FALSE(Denies(motion_));
    EXPECT_TRUE(Denies(false_motion_));
    EXPECT_EQ(chain_.Judge(kMap, motion_ * cam_from_map_, kBegin).num_against, 0);
    EXPECT_GT(chain_.Judge(kMap, false_motion_ * cam_from_map_, kBegin).num_against, kNumPoints / 2);
  }
}

// A map says nothing of its unit, and two views nothing of the length of the way.
TEST_F(FlowChainTest, AScopeThatOnlyTurnsOrStandsStillIsJudgedAsWell) {
  for (const SE3& motion : {SE3{}, Turned(5.0, Eigen::Vector3d::Zero())}) {
    Anchor(0);
    Move(motion, kNumPoints);
    EXPECT_FALSE(Denies(motion));
    EXPECT_FALSE(Denies(Turned(0.0, {1e-9, 0.0, 0.0}) * motion));
    EXPECT_TRUE(Denies(Turned(10.0, {0.0, 0.5, 0.0}) * motion));
  }
}

TEST_F(FlowChainTest, PointsOfTheMapOutvoteAnInstrument) {
  Anchor(40);
  Move(motion_, 40);
  EXPECT_FALSE(Denies(motion_));
  EXPECT_EQ(chain_.Judge(kMap, motion_ * cam_from_map_, kBegin).num_against > kNumPoints / 2, true);
  EXPECT_TRUE(Denies(false_motion_));
}

TEST_F(FlowChainTest, WithoutPointsOfTheMapAQuarterIsEnough) {
  Anchor(0);
  Move(motion_, 60);
  EXPECT_FALSE(Denies(motion_));
  Anchor(0);
  Move(motion_, 30);
  EXPECT_TRUE(Denies(motion_));
}

// A film runs over the lens and takes most of what showed map points along; the rest of the wall goes with the pose.
TEST_F(FlowChainTest, ATrackedPoseStandsWhileMoreSpeaksForItThanAgainst) {
  const SE3 truth = Turned(1.0, {0.3, 0.0, 0.1});
  const Eigen::Vector3d film(0.6, 0.5, 0.0);
  const auto judge = [&](int num_on_film) {
    Anchor(100);
    std::vector<FollowedPoint> to;
    for (int i = 0; i < kNumPoints; ++i) {
      to.push_back(See(i < num_on_film ? Eigen::Vector3d(points_[i] + film) : points_[i], truth));
    }
    chain_.Advance(to);
    return chain_.Judge(kMap, truth * cam_from_map_, kBegin + milliseconds(200));
  };
  const FlowChain::Witness in_part = judge(70);
  EXPECT_TRUE(in_part.denies);
  EXPECT_GE(in_part.num_for, 130);
  EXPECT_FALSE(in_part.DeniesTracked(0));
  // Nearly all of the picture: the inliers of the pose are what is left to hold it.
  const FlowChain::Witness nearly_all = judge(190);
  EXPECT_TRUE(nearly_all.DeniesTracked(100));
  EXPECT_FALSE(nearly_all.DeniesTracked(nearly_all.num_against));
}

TEST_F(FlowChainTest, JudgesNoPoseOfAnotherMapAndNoneForLong) {
  Anchor(0);
  Move(motion_, kNumPoints);
  EXPECT_FALSE(Denies(false_motion_, milliseconds(200), kMap + 1));
  EXPECT_TRUE(Denies(false_motion_, milliseconds(1000)));
  EXPECT_FALSE(Denies(false_motion_, milliseconds(1001)));
}

TEST_F(FlowChainTest, NeedsEightPoints) {
  Anchor(0);
  for (const int num_left : {80, 30, 8}) Move(motion_, kNumPoints, num_left);
  EXPECT_EQ(chain_.points().size(), 8u);
  EXPECT_TRUE(Denies(false_motion_));
  Move(motion_, kNumPoints, 7);
  EXPECT_EQ(chain_.points().size(), 7u);
  EXPECT_FALSE(Denies(false_motion_));
}

// A red-out, water: what is left of the points by chance says nothing.
TEST_F(FlowChainTest, BreaksAtAPictureThatKeepsLessThanAFifth) {
  Anchor(0);
  Move(motion_, kNumPoints, 40);
  EXPECT_EQ(chain_.points().size(), 40u);
  Anchor(0);
  Move(motion_, kNumPoints, 39);
  EXPECT_TRUE(chain_.points().empty());
  EXPECT_FALSE(Denies(false_motion_));
}

TEST_F(FlowChainTest, GoesOnFromPictureToPictureUntilItBreaks) {
  Anchor(20);
  EXPECT_TRUE(chain_.is_fresh());
  std::vector<FollowedPoint> to;
  for (int i = 0; i < kNumPoints; ++i) to.push_back(i % 2 == 0 ? See(points_[i], false_motion_) : FollowedPoint{});
  chain_.Advance(to);
  EXPECT_FALSE(chain_.is_fresh());
  ASSERT_EQ(chain_.points().size(), kNumPoints / 2u);
  to.clear();
  for (int i = 0; i < kNumPoints; i += 2) to.push_back(See(points_[i], motion_));
  chain_.Advance(to);
  EXPECT_FALSE(Denies(motion_));
  EXPECT_TRUE(Denies(false_motion_));
  Anchor(20);
  chain_.Break();
  EXPECT_TRUE(chain_.points().empty());
  EXPECT_FALSE(chain_.is_fresh()) << "the features of the last frame are followed for themselves again";
  EXPECT_FALSE(Denies(false_motion_));
}

TEST_F(FlowChainTest, GoesWithItsMapIntoAnotherOne) {
  Anchor(0);
  Move(motion_, kNumPoints);
  Reframing reframing;
  reframing.old_map_id = kMap;
  reframing.new_map_id = 9;
  reframing.new_from_old.scale = 2.5;
  reframing.new_from_old.rotation = Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitX());
  reframing.new_from_old.translation = {3.0, 1.0, -2.0};
  chain_.Hear(reframing);
  const auto denies = [&](const SE3& motion) {
    const SE3 pose = TransformPose(motion * cam_from_map_, reframing.new_from_old);
    return chain_.Judge(9, pose, kBegin).denies;
  };
  EXPECT_FALSE(denies(motion_));
  EXPECT_TRUE(denies(false_motion_));
}

}  // namespace
}  // namespace haustra::test
