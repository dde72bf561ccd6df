// Which frames can be marked: what the keeper hears of the tracker.
#include "engine/mapping/mark_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

class MarkKeeperTest : public testing::Test {
 protected:
  // The tracker answers with a frame that has no pose, which is what a mark in it is refused for.
  void Answer(std::uint32_t frame_index) {
    AnsweredFrame answered;
    answered.frame_index = frame_index;
    link_.Answer(answered);
  }
  std::string WhyRefused(std::uint32_t frame_index) {
    const CameraModel& camera = colon_.camera();
    const Eigen::Vector2d middle(0.5 * camera.width_px(), 0.5 * camera.height_px());
    return keeper_.Set({frame_index, middle, MarkLabel::From("polyp").value()}).status().message();
  }

  ScriptedColon colon_;
  TrackingLink link_{colon_.config()};
  SceneRegion scene_{colon_.camera(), {}};
  MappingState state_{colon_.config(), colon_.camera(), scene_, colon_.device(),
                      link_,           nullptr,         false,  std::pmr::get_default_resource()};
  MarkKeeper keeper_{state_};
};

TEST_F(MarkKeeperTest, TheNewestFrameIsTheLastThatWasAnswered) {
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("no frame yet"));
  Answer(7);
  Answer(8);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 8 has no measured pose"));
  EXPECT_THAT(WhyRefused(7), HasSubstr("frame 7 has no measured pose"));
  EXPECT_THAT(WhyRefused(9), HasSubstr("frame 9 is not one of the last"));
}

// The mapper was away for longer than the ring holds. What it hears then is old: the doctor saw a later frame.
TEST_F(MarkKeeperTest, WhatWasMissedIsNotTakenForTheNewestFrame) {
  for (std::uint32_t i = 0; i < kKeptAnswers + 25; ++i) Answer(i);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("not known"));
  EXPECT_THAT(WhyRefused(kKeptAnswers - 1), HasSubstr("has no measured pose")) << "it is known by its number";
  Answer(kKeptAnswers + 25);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 537 has no measured pose"));
}

// The tracker answers on while the keeper hears: room for the next frame, after one was lost, comes in the middle.
TEST_F(MarkKeeperTest, ALostFrameDoesNotHideANewerOne) {
  for (std::uint32_t i = 0; i <= kKeptAnswers; ++i) Answer(i);
  AnsweredFrame heard;
  ASSERT_TRUE(link_.answers.TryPop(&heard));
  Answer(kKeptAnswers + 1);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 513 has no measured pose"));
  EXPECT_THAT(WhyRefused(kKeptAnswers), HasSubstr("is not one of the last"));
}

// Whether the last session's frames were heard or still lie in the ring, and whether the ring has lost some.
TEST_F(MarkKeeperTest, ASessionForgetsTheFramesOfTheOneBefore) {
  for (const std::uint32_t num_frames : {3u, static_cast<std::uint32_t>(kKeptAnswers) + 3}) {
    for (const bool is_heard : {false, true}) {
      for (std::uint32_t i = 0; i < num_frames; ++i) Answer(i);
      if (is_heard) keeper_.HearTracker();
      keeper_.BeginSession();
      EXPECT_THAT(WhyRefused(2), HasSubstr("is not one of the last"));
      EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("no frame yet"));
      Answer(0);
      EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 0 has no measured pose"));
      EXPECT_THAT(WhyRefused(2), HasSubstr("is not one of the last"));
    }
  }
}

}  // namespace
}  // namespace haustra::test
