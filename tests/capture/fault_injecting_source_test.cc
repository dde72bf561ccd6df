#include "capture/fault_injecting_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Ten frames at 25 Hz; all pixels of frame i are 10 + i.
class CountingSource final : public FrameSource {
 public:
  const CameraCalibration& calibration() const override { return calibration_; }
  std::uint32_t num_frames() const override { return 10; }
  ImageView static_mask() const override { return {}; }
  Result<Frame> Next(TimePoint) override {
    if (next_ == num_frames()) return NotFound("over");
    image_ = FlatImage(8, 4, PixelFormat::kGrey8, static_cast<std::uint8_t>(10 + next_));
    const Frame frame = {
        .index = next_, .timestamp = TimePoint(std::chrono::milliseconds(40 * next_)), .image = image_.view()};
    ++next_;
    return frame;
  }

 private:
  CameraCalibration calibration_;
  Image image_;
  std::uint32_t next_ = 0;
};

FaultInjectingSource Make(std::string_view script, std::uint64_t seed = 1) {
  Result<std::vector<Fault>> faults = ParseFaultScript(script);
  EXPECT_TRUE(faults.ok()) << faults.status().ToString();
  return FaultInjectingSource(std::make_unique<CountingSource>(), std::move(faults).value(), seed);
}

struct Seen {
  std::vector<int> indices;
  std::vector<int> top_values;
  std::vector<int> bottom_values;
  std::vector<int> times_ms;
};

Seen ReadAll(FaultInjectingSource source) {
  Seen seen;
  for (;;) {
    const Result<Frame> frame = source.Next(kNoDeadline);
    if (!frame.ok()) {
      EXPECT_EQ(frame.code(), StatusCode::kNotFound);
      return seen;
    }
    seen.indices.push_back(static_cast<int>(frame->index));
    seen.top_values.push_back(frame->image.row(0)[0]);
    seen.bottom_values.push_back(frame->image.row(3)[7]);
    seen.times_ms.push_back(static_cast<int>(ToMilliseconds(frame->timestamp.time_since_epoch())));
  }
}

TEST(FaultInjectingSource, EmptyScriptChangesNothing) {
  const Seen seen = ReadAll(Make(""));
  EXPECT_THAT(seen.indices, ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_THAT(seen.top_values, ElementsAre(10, 11, 12, 13, 14, 15, 16, 17, 18, 19));
}

TEST(FaultInjectingSource, DroppedFramesLeaveAGap) {
  EXPECT_THAT(ReadAll(Make("drop 0, drop 3-5")).indices, ElementsAre(1, 2, 6, 7, 8, 9));
}

TEST(FaultInjectingSource, RepeatedFrameComesTwice) {
  const Seen seen = ReadAll(Make("repeat 8"));
  EXPECT_THAT(seen.indices, ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 8, 9));
  EXPECT_EQ(seen.times_ms[8], seen.times_ms[9]);
  EXPECT_EQ(seen.top_values[9], 18);
}

TEST(FaultInjectingSource, BlackFramesAreBlack) {
  EXPECT_THAT(ReadAll(Make("black 1-2")).top_values, ElementsAre(10, 0, 0, 13, 14, 15, 16, 17, 18, 19));
}

TEST(FaultInjectingSource, FrozenFramesKeepThePixelsButNotTheTime) {
  const Seen seen = ReadAll(Make("freeze 4-6"));
  EXPECT_THAT(seen.top_values, ElementsAre(10, 11, 12, 13, 13, 13, 13, 17, 18, 19));
  EXPECT_THAT(seen.times_ms, ElementsAre(0, 40, 80, 120, 160, 200, 240, 280, 320, 360));
}

TEST(FaultInjectingSource, FirstFrameCannotFreeze) {
  EXPECT_THAT(ReadAll(Make("freeze 0-1")).top_values, ElementsAre(10, 10, 12, 13, 14, 15, 16, 17, 18, 19));
}

TEST(FaultInjectingSource, TornFrameShowsTheOneBeforeBelow) {
  const Seen seen = ReadAll(Make("tear 5"));
  EXPECT_EQ(seen.top_values[5], 15);
  EXPECT_EQ(seen.bottom_values[5], 14);
  EXPECT_EQ(seen.bottom_values[6], 16);
}

TEST(FaultInjectingSource, NoiseDependsOnlyOnTheSeed) {
  const Seen a = ReadAll(Make("noise 0-9", 5));
  const Seen b = ReadAll(Make("noise 0-9", 5));
  const Seen c = ReadAll(Make("noise 0-9", 6));
  EXPECT_EQ(a.top_values, b.top_values);
  EXPECT_NE(a.top_values, c.top_values);
}

TEST(FaultInjectingSource, DamageAndUnplugTakeThePlaceOfFrames) {
  FaultInjectingSource source = Make("damage 1, unplug 2-3");
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  const Result<Frame> damaged = source.Next(kNoDeadline);
  EXPECT_EQ(damaged.code(), StatusCode::kDataLoss);
  EXPECT_THAT(damaged.status().message(), HasSubstr("frame 1"));
  EXPECT_EQ(source.Next(kNoDeadline).code(), StatusCode::kUnavailable);
  EXPECT_EQ(source.Next(kNoDeadline).code(), StatusCode::kUnavailable);
  EXPECT_EQ(source.Next(kNoDeadline).value().index, 4u);
}

TEST(FaultInjectingSource, StampsGoWrongAsAsked) {
  EXPECT_THAT(ReadAll(Make("duplicate_stamp 2, backward_stamp 4")).times_ms,
              ElementsAre(0, 40, 40, 120, 119, 200, 240, 280, 320, 360));
}

TEST(ParseFaultScript, MistakesAreQuoted) {
  for (const auto& [script, part] :
       {std::pair<std::string_view, std::string_view>{"drop 1, smash 2", "unknown kind of fault 'smash'"},
        {"drop", "not a kind and a frame"},
        {"drop 5-3", "ends before it begins"},
        {"drop x", "'x' is not a whole number"},
        {"drop 1-2-3", "is not a range"},
        {"drop 99999999999", "is not a frame index"}}) {
    const Result<std::vector<Fault>> faults = ParseFaultScript(script);
    EXPECT_EQ(faults.code(), StatusCode::kInvalidArgument) << script;
    EXPECT_THAT(faults.status().message(), HasSubstr(std::string(part)));
  }
}

}  // namespace
}  // namespace haustra
