// Frames whose time stamps jump, as those of a program may that drives the engine itself: the sources of capture/ let
// none of them through. Nothing may wait for a clock to get where it was.
#include "tests/engine/tracking/tracker_with_mapper.h"

namespace haustra::test {
namespace {

class TimeJumpTest : public TrackerWithMapper {
 protected:
  // Frames from here on, with what is added to their time stamps.
  FrameResult TrackAndMapLater(int num_frames, Duration later) {
    FrameResult result;
    for (int i = 0; i < num_frames; ++i) {
      Result<Frame> frame = colon_.source().Next(kNoDeadline);
      EXPECT_TRUE(frame.ok());
      frame->timestamp += later;
      result = tracker_.Track(*frame, kNoDeadline);
      Map();
    }
    return result;
  }
  std::uint64_t num_keyframes() const { return mapper_.counters().num_keyframes; }
};

TEST_F(TimeJumpTest, KeyframesGoOnAfterAJumpBackOrAhead) {
  ASSERT_EQ(TrackAndMap(40).state, TrackingState::kTracking);
  std::uint64_t before = num_keyframes();
  EXPECT_EQ(TrackAndMapLater(20, -std::chrono::hours(1)).state, TrackingState::kTracking);
  EXPECT_GE(num_keyframes(), before + 2);
  before = num_keyframes();
  EXPECT_EQ(TrackAndMapLater(20, std::chrono::hours(1)).state, TrackingState::kTracking);
  EXPECT_GE(num_keyframes(), before + 2);
}

TEST_F(TimeJumpTest, ALostScopeIsFoundAgainAfterAJumpBack) {
  const FrameResult before = TrackAndMap(40);
  ASSERT_EQ(before.state, TrackingState::kTracking);
  ASSERT_EQ(TrackAndMapLater(2, -std::chrono::hours(1)).state, TrackingState::kTracking);
  device_.sees = false;
  ASSERT_EQ(TrackAndMapLater(1, -std::chrono::hours(1)).state, TrackingState::kLost);
  const FrameResult found = TrackAndMapLater(1, -std::chrono::hours(1));
  EXPECT_EQ(ToString(found.reason), "relocalised") << ToString(found.search);
  EXPECT_EQ(found.map_id, before.map_id);
}

// As soon as by a clock that goes on.
TEST_F(TimeJumpTest, AMapIsFoundedAfterAJumpBack) {
  ScriptedColon reference;
  reference.Move(0.0, 3.0, 100);
  const auto engine = reference.MakeEngine();
  int num_frames = 0;
  while (engine->mapper_counters().num_keyframes == 0) {
    const Result<Frame> frame = reference.source().Next(kNoDeadline);
    ASSERT_TRUE(frame.ok());
    (void)engine->Track(*frame, kNoDeadline);
    while (engine->BackgroundStep()) continue;
    ++num_frames;
  }
  ASSERT_GT(num_frames, 3);
  // The first view is there.
  TrackAndMap(2);
  TrackAndMapLater(num_frames - 2, -std::chrono::hours(1));
  EXPECT_GT(num_keyframes(), 0u) << num_frames;
}

// A moving scope, two frames that are missing, and what is answered then.
struct GapInAMove : TrackerWithMapper {
  void TestBody() override {}
  std::vector<FrameResult> AnswersAfter(bool is_damaged) {
    EXPECT_EQ(TrackAndMap(60).state, TrackingState::kTracking);
    for (int i = 0; i < 2; ++i) {
      const Result<Frame> frame = colon_.source().Next(kNoDeadline);
      EXPECT_TRUE(frame.ok());
      if (is_damaged) (void)tracker_.SkipDamaged(frame->index, frame->timestamp);
    }
    return {TrackAndMap(1), TrackAndMap(1)};
  }
};

TEST(DamagedFrames, AreAnsweredAfterAsFramesThatDidNotCome) {
  const std::vector<FrameResult> after_none = GapInAMove().AnswersAfter(false);
  const std::vector<FrameResult> after_damage = GapInAMove().AnswersAfter(true);
  for (std::size_t i = 0; i < 2; ++i) {
    ASSERT_EQ(after_none[i].state, TrackingState::kTracking);
    ASSERT_EQ(after_damage[i].state, TrackingState::kTracking);
    EXPECT_EQ(after_damage[i].num_inliers, after_none[i].num_inliers) << i;
    EXPECT_EQ(after_damage[i].cam_from_reference.translation, after_none[i].cam_from_reference.translation) << i;
  }
}

}  // namespace
}  // namespace haustra::test
