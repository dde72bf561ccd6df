// When the tracker asks for a keyframe.
#include "engine/tracking/proposer.h"

#include <gtest/gtest.h>

#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

class ProposerTest : public ::testing::Test {
 protected:
  ProposerTest() {
    frame_.timestamp = TimePoint(std::chrono::milliseconds(2000));
    reference_.num_established = 100;
    estimate_.matches.resize(300);
    estimate_.num_established = 70;
  }
  bool IsKeyframe() const { return proposer_.IsKeyframe(tracking_, estimate_, reference_, 1.0); }

  ScriptedColon colon_;
  TrackingLink link_{colon_.config()};
  NoiseModel noise_{colon_.config().noise};
  ProposedView frame_{colon_.config().features.max};
  RepliesHeard heard_;
  Proposer proposer_{colon_.config(), colon_.device(), link_, noise_, frame_, heard_};
  Tracking tracking_;  // its last keyframe was made at time 0, where the scope still is
  LocalKeyframe reference_;
  PoseEstimate estimate_;
};

TEST_F(ProposerTest, AFrameThatHasLeftItsReferenceIsAKeyframe) {
  EXPECT_TRUE(IsKeyframe());
  estimate_.num_established = 90;
  EXPECT_FALSE(IsKeyframe());
}

TEST_F(ProposerTest, NoKeyframeRestsOnFewEstablishedPoints) {
  const int least = colon_.config().tracking.min_inliers;
  estimate_.num_established = least;
  EXPECT_TRUE(IsKeyframe());
  estimate_.num_established = least - 1;
  EXPECT_FALSE(IsKeyframe()) << "though 300 points are seen";
  estimate_.matches.resize(20);
  EXPECT_FALSE(IsKeyframe()) << "nor when the frame is thin";
}

TEST_F(ProposerTest, NoKeyframeFollowsTooSoonOrWhileTheMapperIsBusy) {
  tracking_.course.keyframe_time = frame_.timestamp - std::chrono::milliseconds(50);
  EXPECT_FALSE(IsKeyframe());
  tracking_.course.keyframe_time = TimePoint{};
  link_.num_pending = 1;
  EXPECT_FALSE(IsKeyframe());
}

TEST_F(ProposerTest, AMapOfTwoViewsGrowsAtOnceWhereItIsThin) {
  tracking_ = GoOnFrom({false, 3, SE3{}, 7}, frame_.timestamp - std::chrono::milliseconds(33));
  EXPECT_FALSE(IsKeyframe()) << "300 points hold it";
  estimate_.matches.resize(static_cast<std::size_t>(colon_.config().keyframes.low_inliers) - 1);
  estimate_.num_established = static_cast<int>(estimate_.matches.size());
  EXPECT_TRUE(IsKeyframe());
  const Tracking young = tracking_;
  estimate_.num_established = colon_.config().tracking.min_inliers - 1;
  EXPECT_FALSE(IsKeyframe()) << "a keyframe rests on established points all the same";
  estimate_.num_established = static_cast<int>(estimate_.matches.size());
  LocalMap map;
  map.points.resize(1);
  for (PointMatch& match : estimate_.matches) match = {0, 0};
  frame_.features.num = 1;
  ASSERT_TRUE(proposer_.ProposeKeyframe(estimate_, map, &tracking_));
  link_.num_pending = 0;
  tracking_.course.keyframe_time = young.course.keyframe_time;
  EXPECT_FALSE(IsKeyframe()) << "the map has its third keyframe";
  tracking_ = GoOnFrom({true, 3, SE3{}, 7}, young.course.keyframe_time);
  EXPECT_FALSE(IsKeyframe()) << "a map that was found again has long grown";
}

TEST(LocalMap, WhereThereAreTwoKeyframesThePointsOfBothAreEstablished) {
  LocalMap map;
  LocalPoint of_one, of_two, of_three;
  of_one.keyframe_mask = 0b010;
  of_two.keyframe_mask = 0b011;
  of_three.keyframe_mask = 0b111;
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(map.keyframes.PushBack({}));
  EXPECT_FALSE(map.is_established(of_one));
  EXPECT_TRUE(map.is_established(of_two));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(map.keyframes.PushBack({}));
  EXPECT_FALSE(map.is_established(of_two));
  EXPECT_TRUE(map.is_established(of_three));
}

}  // namespace
}  // namespace haustra::test
