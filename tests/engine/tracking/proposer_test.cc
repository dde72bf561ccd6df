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
    HasKeyframes(colon_.config().mapping.min_map_keyframes);
  }
  void HasKeyframes(int num) {
    map_.keyframes.Clear();
    for (int i = 0; i < num; ++i) ASSERT_TRUE(map_.keyframes.PushBack(reference_));
  }
  bool IsKeyframe(bool has_fewer_points = false) const {
    return proposer_.IsKeyframe(tracking_, estimate_, map_, reference_, has_fewer_points);
  }

  ScriptedColon colon_;
  TrackingLink link_{colon_.config()};
  NoiseModel noise_{colon_.config().noise};
  ProposedView frame_{colon_.config().features.max};
  RepliesHeard heard_;
  Proposer proposer_{colon_.config(), colon_.device(), link_, noise_, frame_, heard_};
  Tracking tracking_;  // its last keyframe was made at time 0, where the scope still is
  LocalKeyframe reference_;
  LocalMap map_;
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

TEST_F(ProposerTest, NoKeyframeWaitsForAClockThatWasSetBack) {
  tracking_.course.keyframe_time = frame_.timestamp + std::chrono::hours(1);
  EXPECT_TRUE(IsKeyframe());
  estimate_.num_established = 90;
  EXPECT_FALSE(IsKeyframe());
  tracking_.course.keyframe_time = frame_.timestamp;
  estimate_.num_established = 70;
  EXPECT_FALSE(IsKeyframe()) << "a time stamp that stands still is too soon";
}

TEST_F(ProposerTest, AThinMapGrowsAtOnceWhileItIsYoung) {
  const int grown = colon_.config().mapping.min_map_keyframes;
  tracking_.course.keyframe_time = frame_.timestamp - std::chrono::milliseconds(33);
  HasKeyframes(grown - 1);
  EXPECT_FALSE(IsKeyframe()) << "300 points hold it";
  estimate_.matches.resize(static_cast<std::size_t>(colon_.config().keyframes.low_inliers) - 1);
  EXPECT_TRUE(IsKeyframe());
  HasKeyframes(2);
  EXPECT_TRUE(IsKeyframe());
  HasKeyframes(grown);
  EXPECT_FALSE(IsKeyframe());
}

TEST_F(ProposerTest, AThinGrownMapGrowsAtOnceOnPointsFromBefore) {
  const int least = colon_.config().tracking.min_inliers;
  tracking_.course.keyframe_time = frame_.timestamp - std::chrono::milliseconds(33);
  estimate_.num_established = estimate_.num_seasoned = least;
  EXPECT_FALSE(IsKeyframe()) << "300 points hold it";
  estimate_.matches.resize(static_cast<std::size_t>(colon_.config().keyframes.low_inliers) - 1);
  EXPECT_TRUE(IsKeyframe());
  estimate_.num_seasoned = least - 1;
  EXPECT_FALSE(IsKeyframe()) << "the others may be on debris";
}

TEST_F(ProposerTest, AYoungMapHasFewEstablishedPointsAndGrowsAllTheSame) {
  const int grown = colon_.config().mapping.min_map_keyframes;
  estimate_.num_established = colon_.config().tracking.min_inliers - 1;
  HasKeyframes(grown - 1);
  EXPECT_TRUE(IsKeyframe());
  HasKeyframes(grown);
  EXPECT_FALSE(IsKeyframe());
}

TEST_F(ProposerTest, WhatTheLadderLeavesOutMakesNoFrameThin) {
  const double share = colon_.config().scheduler.reduced_share;
  const auto few = static_cast<std::size_t>(share * colon_.config().keyframes.low_inliers);
  estimate_.num_established = 90;
  estimate_.matches.resize(few + 1);
  EXPECT_TRUE(IsKeyframe()) << "all points were searched";
  EXPECT_FALSE(IsKeyframe(true)) << "one in so many was";
  frame_.features.is_reduced = reference_.is_reduced = true;
  EXPECT_FALSE(IsKeyframe()) << "and so where features are left out, though the reference has no more";
  estimate_.matches.resize(few - 1);
  EXPECT_TRUE(IsKeyframe()) << "this is thin";
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
