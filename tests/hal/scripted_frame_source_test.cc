#include "hal/fakes/scripted_frame_source.h"

#include <gtest/gtest.h>

#include "hal/fakes/frame_tag.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

CameraCalibration SmallCamera() {
  CameraCalibration calibration;
  calibration.width_px = 16;
  calibration.height_px = 4;
  return calibration;
}

TimePoint AtMs(int ms) { return TimePoint(milliseconds(ms)); }

TEST(FrameTag, ComesBackFromThePicture) {
  std::vector<std::uint8_t> pixels(32, 9);
  const ImageView image{pixels.data(), 16, 2, 16, PixelFormat::kGrey8};
  EXPECT_FALSE(ReadFrameTag(image).has_value());
  WriteFrameTag(0xfedcba98u, pixels);
  EXPECT_EQ(ReadFrameTag(image), 0xfedcba98u);
  EXPECT_FALSE(ReadFrameTag(ImageView{pixels.data(), 4, 2, 16, PixelFormat::kGrey8}).has_value());
  EXPECT_FALSE(ReadFrameTag(ImageView{}).has_value());
}

TEST(ScriptedFrameSource, GivesItsFramesAndThenNotFound) {
  ScriptedFrameSource source(SmallCamera());
  source.AddFrames(3, AtMs(0), milliseconds(40));
  EXPECT_EQ(source.num_frames(), 3u);
  for (std::uint32_t i = 0; i < 3; ++i) {
    const Result<Frame> frame = source.Next(kNoDeadline);
    ASSERT_TRUE(frame.ok());
    EXPECT_EQ((*frame).index, i);
    EXPECT_EQ((*frame).timestamp, AtMs(40 * static_cast<int>(i)));
    EXPECT_EQ((*frame).image.width, 16);
    EXPECT_EQ((*frame).image.height, 4);
    EXPECT_EQ(ReadFrameTag((*frame).image), i);
  }
  EXPECT_EQ(source.Next(kNoDeadline).code(), StatusCode::kNotFound);
}

TEST(ScriptedFrameSource, FailuresAndGapsPassWithTheirIndices) {
  ScriptedFrameSource source(SmallCamera());
  source.AddFrame(AtMs(0));
  source.AddFailure(StatusCode::kDataLoss, "frames/000001.jpg: torn");
  source.AddGap(5);
  source.AddFrame(AtMs(280));
  EXPECT_EQ((*source.Next(kNoDeadline)).index, 0u);
  const Result<Frame> damaged = source.Next(kNoDeadline);
  EXPECT_EQ(damaged.code(), StatusCode::kDataLoss);
  EXPECT_EQ(damaged.status().message(), "frames/000001.jpg: torn");
  EXPECT_EQ((*source.Next(kNoDeadline)).index, 7u);
  EXPECT_EQ(source.num_frames(), 8u);
}

TEST(ScriptedFrameSource, LiveFrameIsNotThereBeforeItIsDue) {
  ManualClock clock;
  ScriptedFrameSource source(SmallCamera(), &clock);
  source.SetEndless(true);
  source.AddFrame(AtMs(40));
  EXPECT_EQ(source.num_frames(), 0u);
  EXPECT_EQ(source.Next(AtMs(10)).code(), StatusCode::kDeadlineExceeded);
  EXPECT_EQ(clock.Now(), AtMs(10));
  const Result<Frame> frame = source.Next(AtMs(50));
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(clock.Now(), AtMs(40));
}

TEST(ScriptedFrameSource, StaticMaskIsWhatWasSet) {
  ScriptedFrameSource source(SmallCamera());
  EXPECT_TRUE(source.static_mask().is_empty());
  source.SetStaticMask(std::vector<std::uint8_t>(16 * 4, 255));
  EXPECT_EQ(source.static_mask().width, 16);
  EXPECT_EQ(source.static_mask().row(3)[15], 255);
}

}  // namespace
}  // namespace haustra
