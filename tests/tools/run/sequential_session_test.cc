#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "hal/fakes/manual_clock.h"
#include "platform/session/session.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using test::RecordingObserver;
using test::ScriptedColon;

TEST(SequentialSession, EveryFrameIsAnsweredInOrder) {
  ScriptedColon colon;
  colon.Occlude(4);
  const auto engine = colon.MakeEngine();
  RecordingObserver observer;
  const ManualClock clock;
  const auto session = RunSequential(colon.source(), *engine, clock, observer, test::kNeverStop);
  ASSERT_TRUE(session.ok()) << session.status().ToString();
  EXPECT_EQ(observer.calls, (std::vector<std::string>{"frame 0", "frame 1", "frame 2", "frame 3"}));
  for (std::uint32_t i = 0; i < 4; ++i) {
    EXPECT_EQ(observer.frames[i].result.timestamp, colon.TimeOf(i));
    EXPECT_FALSE(observer.frames[i].is_dropped || observer.frames[i].is_damaged);
  }
  EXPECT_EQ(session->video_time, 4 * test::kFramePeriod);
}

TEST(SequentialSession, DamagedFrameIsToldThenAnsweredAndTheNextGoesOn) {
  ScriptedColon colon(TimePoint(std::chrono::seconds(100)));
  colon.Occlude(2);
  colon.Damage("two.jpg: truncated");
  colon.Occlude(1);
  const auto engine = colon.MakeEngine();
  RecordingObserver observer;
  const auto session = RunSequential(colon.source(), *engine, ManualClock(), observer, test::kNeverStop);
  ASSERT_TRUE(session.ok()) << session.status().ToString();
  EXPECT_EQ(observer.calls,
            (std::vector<std::string>{"frame 0", "frame 1", "damaged 2 two.jpg: truncated", "frame 2", "frame 3"}));
  EXPECT_TRUE(observer.frames[2].is_damaged);
  EXPECT_EQ(observer.frames[2].result.reason, TrackingReason::kDamagedFrame);
  EXPECT_EQ(observer.frames[2].result.timestamp, colon.TimeOf(2));
  EXPECT_EQ(session->video_time, 4 * test::kFramePeriod);
}

TEST(SequentialSession, ErrorOfTheSourceEndsTheSessionWithItsStatus) {
  ScriptedColon colon;
  colon.Occlude(3);
  colon.Fail(StatusCode::kUnavailable, "grabber: cable pulled");
  colon.Occlude(3);
  const auto engine = colon.MakeEngine();
  RecordingObserver observer;
  const auto session = RunSequential(colon.source(), *engine, ManualClock(), observer, test::kNeverStop);
  EXPECT_EQ(session.code(), StatusCode::kUnavailable);
  EXPECT_EQ(session.status().message(), "grabber: cable pulled");
  EXPECT_EQ(observer.frames.size(), 3u);
}

TEST(SequentialSession, StopEndsAfterTheFrameInHandWithSuccess) {
  ScriptedColon colon;
  colon.Occlude(10);
  const auto engine = colon.MakeEngine();
  std::atomic<bool> stop{false};
  RecordingObserver observer;
  observer.on_frame = [&](const FrameOutcome& outcome) { stop = outcome.result.frame_index == 4; };
  const auto session = RunSequential(colon.source(), *engine, ManualClock(), observer, stop);
  ASSERT_TRUE(session.ok());
  EXPECT_EQ(observer.frames.size(), 5u);
  EXPECT_EQ(session->video_time, 5 * test::kFramePeriod);
}

// Mapping follows tracking within the same frame: the map that frame k founds is there for frame k + 1.
TEST(SequentialSession, MapIsFoundedInTheFrameThatProposesIt) {
  ScriptedColon colon;
  colon.Move(0.0, 1.2, 30);
  const auto engine = colon.MakeEngine();
  RecordingObserver observer;
  ASSERT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), observer, test::kNeverStop).ok());
  ASSERT_FALSE(observer.events.empty());
  EXPECT_EQ(observer.events[0].kind, MapEventKind::kMapCreated);
  const std::uint32_t founded = observer.events[0].frame_index;
  EXPECT_EQ(observer.frames[founded].result.reason, TrackingReason::kMapProposed);
  ASSERT_LT(founded + 1, observer.frames.size());
  EXPECT_EQ(observer.frames[founded + 1].result.state, TrackingState::kTracking);
  const auto position = [&](const std::string& call) {
    return std::find(observer.calls.begin(), observer.calls.end(), call) - observer.calls.begin();
  };
  const auto event = position("map_created " + std::to_string(founded));
  EXPECT_GT(event, position("frame " + std::to_string(founded)));
  EXPECT_LT(event, position("frame " + std::to_string(founded + 1)));
}

// Frame numbers begin anew: a number that the session has not answered means no frame of the one before.
TEST(SequentialSession, NoFrameOfAnEarlierSessionIsMarked) {
  ScriptedColon colon;
  colon.Move(0.0, 2.4, 60);
  const auto engine = colon.MakeEngine();
  const auto mark = [&](std::uint32_t frame_index, const char* label) {
    return engine->SetMark({frame_index, {200.0, 150.0}, MarkLabel::From(label).value()}).code();
  };
  RecordingObserver observer;
  ASSERT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), observer, test::kNeverStop).ok());
  ASSERT_EQ(mark(30, "first"), StatusCode::kOk) << "between two sessions the last one counts";
  ScriptedColon next;
  next.Occlude(3);
  ASSERT_TRUE(RunSequential(next.source(), *engine, ManualClock(), observer, test::kNeverStop).ok());
  EXPECT_EQ(mark(30, "second"), StatusCode::kNotFound);
  ScriptedColon empty;
  ASSERT_TRUE(RunSequential(empty.source(), *engine, ManualClock(), observer, test::kNeverStop).ok());
  EXPECT_EQ(mark(kNewestFrame, "third"), StatusCode::kNotFound);
}

}  // namespace
}  // namespace haustra
