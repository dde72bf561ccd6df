#include "tools/run/final_poses.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "hal/fakes/manual_clock.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

// Its answers: at rest, seven frames of one map without a loss.
class FollowAdjusted : public ::testing::Test {
 protected:
  static constexpr MapId kMap = 4;

  FollowAdjusted() {
    for (FinalPose& pose : poses_) pose = {true, {kMap, SE3{}}, 0};
  }
  static SE3 MovedBy(double x) { return SE3(Eigen::Quaterniond::Identity(), {x, 0.0, 0.0}); }
  std::vector<double> Travels() const {
    std::vector<double> travels;
    for (const FinalPose& pose : poses_) travels.push_back(pose.pose.cam_from_map.translation.x());
    return travels;
  }

  std::vector<FinalPose> poses_ = std::vector<FinalPose>(7);
  std::vector<bool> starts_ = std::vector<bool>(7, false);
};

void ExpectNear(const std::vector<double>& travels, const std::vector<double>& expected) {
  ASSERT_EQ(travels.size(), expected.size());
  for (std::size_t i = 0; i < travels.size(); ++i) EXPECT_NEAR(travels[i], expected[i], 1e-12) << i;
}

TEST_F(FollowAdjusted, FramesBetweenAreCarriedInProportionAndBeyondTheCorrectionHolds) {
  haustra::FollowAdjusted({{1, MovedBy(0.1)}, {5, MovedBy(0.5)}}, starts_, &poses_);
  ExpectNear(Travels(), {0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.5});
}

TEST_F(FollowAdjusted, ATurnIsSharedLikeATravel) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()));
  haustra::FollowAdjusted({{1, SE3{}}, {5, SE3(turn, Eigen::Vector3d::Zero())}}, starts_, &poses_);
  for (int i = 1; i <= 5; ++i) {
    EXPECT_NEAR(RotationAngle(poses_[i].pose.cam_from_map.rotation, Eigen::Quaterniond::Identity()), 0.1 * (i - 1),
                1e-12);
  }
}

// The correction is one of the camera: it turns with the scope.
TEST_F(FollowAdjusted, TheCorrectionIsSeenFromTheCamera) {
  const SE3 looks_back(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY())), Eigen::Vector3d::Zero());
  poses_[3].pose.cam_from_map = looks_back;
  haustra::FollowAdjusted({{2, MovedBy(0.1)}}, starts_, &poses_);
  EXPECT_NEAR(poses_[3].pose.cam_from_map.InverseTranslation().x(), 0.1, 1e-12);
  EXPECT_NEAR(poses_[4].pose.cam_from_map.InverseTranslation().x(), -0.1, 1e-12);
}

TEST_F(FollowAdjusted, ALossAnotherMapAndARelocalisationEndAStretch) {
  poses_[2].is_localised = false;
  haustra::FollowAdjusted({{1, MovedBy(0.1)}}, starts_, &poses_);
  ExpectNear(Travels(), {0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0});

  poses_[5].pose.map_id = kMap + 1;
  haustra::FollowAdjusted({{4, MovedBy(0.2)}}, starts_, &poses_);
  ExpectNear(Travels(), {0.1, 0.1, 0.0, 0.2, 0.2, 0.0, 0.0});

  starts_[6] = true;
  haustra::FollowAdjusted({{6, MovedBy(0.3)}}, starts_, &poses_);
  ExpectNear(Travels(), {0.1, 0.1, 0.0, 0.2, 0.2, 0.0, 0.3});
}

// The pose with which a frame became a keyframe is not the one that the bundles have given it since.
TEST(FinalPoses, FramesOfKeyframesHaveThePoseThatWasAdjusted) {
  test::ScriptedColon colon;
  colon.Move(0.0, 3.0, 75);
  const auto engine = colon.MakeEngine();
  RunRecord record({});
  ASSERT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), record, test::kNeverStop).ok());
  const std::vector<FinalPose> poses = ResolveAll(record, *engine);
  int num_moved = 0;
  engine->atlas().keyframes().ForEach([&](KeyframeHandle, const Keyframe& keyframe) {
    const FinalPose& pose = poses[keyframe.frame_index];
    ASSERT_TRUE(pose.is_localised) << keyframe.frame_index;
    const SE3 own_from_final = keyframe.cam_from_map * pose.pose.cam_from_map.Inverse();
    EXPECT_LT(own_from_final.Log().norm(), 1e-9) << keyframe.frame_index;
    ResolvedPose answered;
    if (!engine->Resolve(record.frames()[keyframe.frame_index].result, &answered)) return;
    num_moved += (keyframe.cam_from_map * answered.cam_from_map.Inverse()).Log().norm() > 1e-9;
  });
  EXPECT_GE(num_moved, 1) << "the bundles have changed nothing";
}

}  // namespace
}  // namespace haustra
