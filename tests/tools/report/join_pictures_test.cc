#include "tools/report/join_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "capture/codec/image_codec.h"
#ifdef HAUSTRA_HAS_VIDEO
#include "tests/capture/video_writer.h"
#endif
#include "tests/tools/evaluate/text_folder.h"
#include "tests/tools/report/small_report.h"

namespace haustra::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::size_t Count(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// The sequence of SmallRun: 60 small grey frames with its times.
class JoinPicturesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string times;
    for (int i = 0; i < 60; ++i) {
      char name[32], time[32];
      std::snprintf(name, sizeof(name), "seq/frames/%06d.png", i);
      std::snprintf(time, sizeof(time), "%.6f\n", 1.0 + 0.04 * i);
      times += time;
      Image image(32, 24, PixelFormat::kGrey8);
      for (int y = 0; y < 24; ++y) std::fill_n(image.row(y), 32, static_cast<std::uint8_t>(4 * i));
      folder_.Write(name, "");
      ASSERT_TRUE(WritePng(folder_.At(name), image.view()).ok());
    }
    folder_.Write("seq/times.txt", times);
    folder_.Write(
        "seq/calib.yaml",
        "model: pinhole\nwidth_px: 32\nheight_px: 24\nrate_hz: 25\nintrinsics: {fx: 20, fy: 20, cx: 15.5, cy: 11.5}\n"
        "coefficients: {k1: 0, k2: 0, p1: 0, p2: 0}\n");
    options_.sequence = folder_.At("seq");
    evaluate::MapGeometry geometry;
    geometry.camera.width_px = 32;
    run_.geometry[0] = geometry;
    // Keyframes 9 (frame 49) and 1 (frame 6) share points 100 and 101; each sees one more.
    models_[0].keyframes[9] = {"000049.jpg", {{100, {1, 2}}, {101, {3, 4}}, {102, {5, 6}}}};
    models_[0].keyframes[1] = {"000006.jpg", {{100, {7, 8}}, {101, {9, 10}}, {103, {11, 12}}}};
  }
  Result<std::string> Html() {
    const evaluate::Evaluation evaluation = EvaluateRun(run_, ShiftedReference(60), {});
    return JoinPicturesHtml(run_, evaluation, models_, options_);
  }

  evaluate::TextFolder folder_;
  evaluate::RunOutput run_ = SmallRun();
  std::map<int, MapModel> models_;
  PictureOptions options_;
};

TEST_F(JoinPicturesTest, MergeHasBothFramesAndTheirSharedPoints) {
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_EQ(Count(*html, "<figure>"), 1u);
  EXPECT_EQ(Count(*html, "href=\"data:image/jpeg;base64,"), 2u);
  EXPECT_EQ(Count(*html, "<line "), 2u);
  EXPECT_THAT(*html, HasSubstr("<line x1=\"1.0\" y1=\"2.0\" x2=\"47.0\" y2=\"8.0\"/>"));  // 32 + 8 + 7
  EXPECT_THAT(*html, HasSubstr("merge at frame 49: map 0 and map 1; right: frame 6. By the ground truth: true"));
  EXPECT_THAT(*html, HasSubstr("2 map points are seen by both keyframes"));
}

TEST_F(JoinPicturesTest, CulledKeyframeHasNoMatchesAndThatIsSaid) {
  models_[0].keyframes.erase(1);
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_EQ(Count(*html, "data:image"), 2u);
  EXPECT_EQ(Count(*html, "<line "), 0u);
  EXPECT_THAT(*html, HasSubstr("is not in the final map"));
}

TEST_F(JoinPicturesTest, FrameOfAnotherSessionIsNotShown) {
  run_.events[5].details = "accepted keyframe=9 other_keyframe=1 other_session=0";
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_EQ(Count(*html, "data:image"), 1u);
  EXPECT_THAT(*html, HasSubstr("is not one of this run"));
}

TEST_F(JoinPicturesTest, JoinsWithoutAPictureDoNotShiftTheOthers) {
  run_.frames[10].reason = "recovered";  // before the merge
  run_.events.insert(run_.events.begin() + 2, EventWith(30, "relocalised", 1, -1, "50 inliers"));
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_THAT(*html, HasSubstr("merge at frame 49: map 0 and map 1"));
  EXPECT_EQ(Count(*html, "<figure>"), 1u);
}

// The run may have guessed its calibration, and had the rate from the command line.
TEST_F(JoinPicturesTest, SequenceNeedsNeitherCalibrationNorTimes) {
  folder_.Remove("seq/calib.yaml");
  ASSERT_TRUE(Html().ok()) << Html().status().ToString();
  folder_.Remove("seq/times.txt");
  for (evaluate::RunFrame& frame : run_.frames) frame.timestamp_ns -= 1000000000;
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_EQ(Count(*html, "data:image"), 2u);
}

TEST_F(JoinPicturesTest, PartThatTheRunHasReadIsThatOfTheRun) {
  run_.figures.part.first_frame = 10;
  EXPECT_THAT(Html().status().message(), HasSubstr("frame 16 has the time 1.640000 s, the run says 1.240000 s"));
  for (evaluate::RunFrame& frame : run_.frames) frame.timestamp_ns += 400000000;
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_EQ(Count(*html, "data:image"), 2u);
}

TEST_F(JoinPicturesTest, AnotherSequenceIsRefused) {
  run_.frames[49].timestamp_ns += 20000000;
  const Result<std::string> html = Html();
  EXPECT_EQ(html.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(html.status().message(), HasSubstr("frame 49 has the time 2.960000 s, the run says 2.980000 s"));
}

TEST_F(JoinPicturesTest, MissingSequenceIsNamed) {
  options_.sequence = folder_.At("none");
  const Result<std::string> html = Html();
  EXPECT_EQ(html.code(), StatusCode::kNotFound);
  EXPECT_THAT(html.status().message(), HasSubstr("none: no such file or folder"));
}

TEST_F(JoinPicturesTest, NumberOfPicturesIsLimitedAndThatIsSaid) {
  run_.events.push_back(EventWith(58, "loop_closed", 0, -1, "accepted keyframe=9 other_keyframe=1 other_frame=6"));
  options_.max_joins = 1;
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_EQ(Count(*html, "<figure>"), 1u);
  EXPECT_THAT(*html, HasSubstr("1 of 2 shown"));
}

TEST_F(JoinPicturesTest, RunWithoutMergesSaysSo) {
  run_.events.erase(run_.events.begin() + 5);
  const Result<std::string> html = Html();
  ASSERT_TRUE(html.ok());
  EXPECT_THAT(*html, HasSubstr("No maps were merged"));
  EXPECT_THAT(*html, Not(HasSubstr("<figure>")));
}

#ifdef HAUSTRA_HAS_VIDEO
// A copy of the recording that was cut, or another one.
TEST_F(JoinPicturesTest, ARecordingThatEndsBeforeAFrameOfTheRunIsRefused) {
  std::vector<Image> frames;
  for (int i = 0; i < 20; ++i) {
    frames.emplace_back(32, 24, PixelFormat::kGrey8);
    for (int y = 0; y < 24; ++y) std::fill_n(frames.back().row(y), 32, static_cast<std::uint8_t>(4 * i));
  }
  options_.sequence = folder_.At("short.mkv");
  ASSERT_EQ(WriteVideo(options_.sequence, "ffv1", 25, frames), "");
  for (evaluate::RunFrame& frame : run_.frames) frame.timestamp_ns -= 1000000000;
  const Result<std::string> html = Html();
  EXPECT_EQ(html.code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(html.status().message(), options_.sequence + ": has no frame 49: not the sequence of this run");
}
#endif

}  // namespace
}  // namespace haustra::report
