#include "tools/render/event_script.h"

#include <gtest/gtest.h>

namespace haustra::render {
namespace {

TEST(EventScript, ListGivesEventsInOrder) {
  const auto events = ParseEvents("redout@8+1.4,jump@12.5");
  ASSERT_TRUE(events.ok());
  ASSERT_EQ(events->size(), 2u);
  EXPECT_EQ((*events)[0].kind, EventKind::kRedout);
  EXPECT_DOUBLE_EQ((*events)[0].start_s, 8.0);
  EXPECT_DOUBLE_EQ((*events)[0].duration_s, 1.4);
  EXPECT_EQ((*events)[1].kind, EventKind::kJump);
  EXPECT_DOUBLE_EQ((*events)[1].start_s, 12.5);
  EXPECT_GT((*events)[1].duration_s, 0.0);
}

TEST(EventScript, NoneGivesNoEvents) {
  EXPECT_TRUE(ParseEvents("none")->empty());
  EXPECT_TRUE(ParseEvents("")->empty());
}

TEST(EventScript, EveryKindReadsBackFromItsName) {
  for (const EventKind kind :
       {EventKind::kRedout, EventKind::kWater, EventKind::kBubbles, EventKind::kDebris, EventKind::kBlur,
        EventKind::kJump, EventKind::kSlip, EventKind::kNarrowBand, EventKind::kInstrument}) {
    const auto events = ParseEvents(std::string(ToString(kind)) + "@1");
    ASSERT_TRUE(events.ok()) << ToString(kind);
    EXPECT_EQ((*events)[0].kind, kind);
  }
}

TEST(EventScript, MistakeIsNamed) {
  for (const char* script : {"redout", "smoke@3", "redout@", "redout@x", "redout@-1", "redout@3+", "redout@3+0",
                             "redout@3+nan", "redout@1,,water@2", "redout@3s"}) {
    const auto events = ParseEvents(script);
    ASSERT_FALSE(events.ok()) << script;
    EXPECT_EQ(events.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(events.status().message().find("event '"), std::string::npos);
  }
}

TEST(EventScript, EnvelopeIsZeroOutsideAndOneInTheMiddle) {
  const Event event{EventKind::kWater, 2.0, 1.0};
  EXPECT_EQ(event.Envelope(1.99), 0.0);
  EXPECT_EQ(event.Envelope(3.01), 0.0);
  EXPECT_EQ(event.Envelope(2.5), 1.0);
  EXPECT_GT(event.Envelope(2.08), 0.0);
  EXPECT_LT(event.Envelope(2.08), 1.0);
}

TEST(FrameSpans, CoverEveryFrameThatAnEventTouches) {
  const std::vector<Event> events = {{EventKind::kBlur, 3.02, 0.5}, {EventKind::kRedout, 1.0, 0.4}};
  const auto spans = FrameSpans(events, 25.0, 100);
  ASSERT_EQ(spans.size(), 2u);
  EXPECT_EQ(spans[0].first_frame, 25);
  EXPECT_EQ(spans[0].last_frame, 35);
  EXPECT_EQ(spans[0].kind, EventKind::kRedout);
  // Each frame with an envelope above zero lies in a span.
  for (const Event& event : events) {
    for (int frame = 0; frame < 100; ++frame) {
      if (event.Envelope(frame / 25.0) <= 0.0) continue;
      bool is_covered = false;
      for (const FrameSpan& s : spans) is_covered = is_covered || (frame >= s.first_frame && frame <= s.last_frame);
      EXPECT_TRUE(is_covered) << frame;
    }
  }
}

TEST(FrameSpans, ThoseThatShowTheSceneAreNotHidden) {
  const auto events = ParseEvents("narrowband@1+1,water@1.5+1,instrument@2+1");
  ASSERT_TRUE(events.ok());
  const auto spans = FrameSpans(*events, 25.0, 100);
  ASSERT_EQ(spans.size(), 3u);
  const auto hidden = HiddenSpans(spans);
  ASSERT_EQ(hidden.size(), 1u);
  EXPECT_EQ(hidden[0].kind, EventKind::kWater);
  EXPECT_TRUE(HidesScene(EventKind::kJump));
  EXPECT_TRUE(HidesScene(EventKind::kSlip));
  EXPECT_FALSE(HidesScene(EventKind::kNarrowBand));
}

// No number of frames is as large as these.
TEST(FrameSpans, AnyTimeIsOne) {
  const auto spans = FrameSpans({{EventKind::kRedout, 1.0, 1e12}, {EventKind::kWater, 1e12, 1.0}}, 25.0, 100);
  ASSERT_EQ(spans.size(), 1u);
  EXPECT_EQ(spans[0].first_frame, 25);
  EXPECT_EQ(spans[0].last_frame, 99);
}

TEST(FrameSpans, AreCutAtTheEndOfTheSequence) {
  const std::vector<Event> events = {{EventKind::kWater, 3.5, 2.0}, {EventKind::kWater, 9.0, 1.0}};
  const auto spans = FrameSpans(events, 25.0, 100);
  ASSERT_EQ(spans.size(), 1u);
  EXPECT_EQ(spans[0].last_frame, 99);
}

}  // namespace
}  // namespace haustra::render
