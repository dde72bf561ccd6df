#include <gtest/gtest.h>

#include "platform/session/frame_pacer.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

Frame FrameAt(std::uint32_t index, TimePoint timestamp) {
  Frame frame;
  frame.index = index;
  frame.timestamp = timestamp;
  return frame;
}

TEST(FrameNumbering, MissingFrameComesOnePeriodAfterTheLast) {
  FrameNumbering numbering(25.0);
  numbering.Seen(FrameAt(0, TimePoint(seconds(5))));
  const FrameNumbering::Stamp first = numbering.Missing();
  const FrameNumbering::Stamp second = numbering.Missing();
  EXPECT_EQ(first.frame_index, 1u);
  EXPECT_EQ(first.timestamp, TimePoint(milliseconds(5040)));
  EXPECT_EQ(second.frame_index, 2u);
  EXPECT_EQ(second.timestamp, TimePoint(milliseconds(5080)));
}

TEST(FrameNumbering, SeenFrameTakesOverAgain) {
  FrameNumbering numbering(25.0);
  numbering.Seen(FrameAt(0, TimePoint(seconds(5))));
  (void)numbering.Missing();
  numbering.Seen(FrameAt(7, TimePoint(seconds(6))));
  EXPECT_EQ(numbering.Missing().frame_index, 8u);
  EXPECT_EQ(numbering.end_index(), 9u);
  EXPECT_EQ(numbering.end_time(), TimePoint(milliseconds(6080)));
}

TEST(FrameNumbering, VideoTimeIsFromFirstToLastAndOnePeriod) {
  FrameNumbering numbering(50.0);
  EXPECT_EQ(numbering.video_time(), Duration{0});
  numbering.Seen(FrameAt(0, TimePoint(seconds(5))));
  EXPECT_EQ(numbering.video_time(), Duration(milliseconds(20)));
  numbering.Seen(FrameAt(1, TimePoint(seconds(8))));
  EXPECT_EQ(numbering.video_time(), Duration(milliseconds(3020)));
}

// Time stamps of recordings count from 1970; a damaged first frame must not make the video 50 years long.
TEST(FrameNumbering, MissingFramesBeforeTheFirstHaveNoTimeAndLeaveTheVideoTime) {
  FrameNumbering numbering(25.0);
  EXPECT_EQ(numbering.Missing().frame_index, 0u);
  EXPECT_EQ(numbering.Missing().timestamp, TimePoint{});
  EXPECT_EQ(numbering.end_time(), TimePoint{});
  numbering.Seen(FrameAt(2, TimePoint(seconds(1'600'000'000))));
  EXPECT_EQ(numbering.video_time(), Duration(milliseconds(40)));
}

TEST(FrameNumbering, UnknownRateCountsAs25Hz) {
  FrameNumbering numbering(0.0);
  numbering.Seen(FrameAt(0, TimePoint{}));
  EXPECT_EQ(numbering.Missing().timestamp, TimePoint(milliseconds(40)));
}

}  // namespace
}  // namespace haustra
