#include "capture/video_source.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/open_sequence.h"
#include "tests/capture/temp_folder.h"
#include "tests/capture/video_writer.h"

namespace haustra {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kNumFrames = 12;

// Level of frame i; apart enough to tell frames after lossy coding.
int LevelOf(std::uint32_t i) { return 30 + 15 * static_cast<int>(i); }

class VideoSourceTest : public ::testing::Test {
 protected:
  VideoSourceTest() { folder_.Write("calib.yaml", kSmallCalibration); }

  std::string WriteLevels(std::string_view name, const std::string& codec) {
    std::vector<Image> frames;
    for (std::uint32_t i = 0; i < kNumFrames; ++i) {
      frames.push_back(FlatImage(64, 48, PixelFormat::kGrey8, static_cast<std::uint8_t>(LevelOf(i))));
    }
    const std::string path = folder_.Path(name);
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    EXPECT_EQ(WriteVideo(path, codec, 25, frames), "");
    return path;
  }
  // The grey value that limited-range video (16 to 235) shows for a stored luma.
  static double Expanded(int luma) { return (luma - 16) * 255.0 / 219.0; }

  TempFolder folder_;
};

TEST_F(VideoSourceTest, IsBuiltIn) { EXPECT_TRUE(HasVideoSupport()); }

TEST_F(VideoSourceTest, LosslessVideoGivesItsPixelsAndTimes) {
  const std::string path = folder_.Path("a.mkv");
  std::vector<Image> frames;
  for (int i = 0; i < 3; ++i) {
    frames.push_back(RampImage(64, 48, PixelFormat::kGrey8));
    frames.back().row(0)[0] = static_cast<std::uint8_t>(i);
  }
  ASSERT_EQ(WriteVideo(path, "ffv1", 25, frames), "");
  Result<std::unique_ptr<FrameSource>> source = OpenVideo(path, {.channels = ChannelChoice::kGrey});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  for (std::uint32_t i = 0; i < 3; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->timestamp.time_since_epoch().count(), 40'000'000 * i);
    EXPECT_EQ(PixelsOf(frame->image), PixelsOf(frames[i].view()));
  }
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
}

TEST_F(VideoSourceTest, AllContainersAreRead) {
  for (const auto& [name, codec] : {std::pair<std::string_view, std::string>{"a.mov", "mpeg4"},
                                    {"a.mp4", "mpeg4"},
                                    {"a.avi", "mpeg4"},
                                    {"a.mkv", "mpeg4"},
                                    {"b.avi", "mjpeg"}}) {
    const std::string path = WriteLevels(name, codec);
    Result<std::unique_ptr<FrameSource>> source = OpenSequence(path, {});
    ASSERT_TRUE(source.ok()) << source.status().ToString();
    for (std::uint32_t i = 0; i < kNumFrames; ++i) {
      const Result<Frame> frame = (*source)->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok()) << name << ": " << frame.status().ToString();
      EXPECT_EQ(frame->index, i);
      EXPECT_EQ(frame->timestamp.time_since_epoch().count(), 40'000'000 * i) << name;
      EXPECT_EQ(frame->image.format, PixelFormat::kBgr8);
      const double expected = codec == "mjpeg" ? LevelOf(i) : Expanded(LevelOf(i));
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(frame->image.row(24)[3 * 32 + c], expected, 5.0) << name;
    }
    EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
  }
}

TEST_F(VideoSourceTest, MovStatesItsNumberOfFrames) {
  const std::string path = WriteLevels("a.mov", "mpeg4");
  EXPECT_EQ(OpenVideo(path, {}).value()->num_frames(), 12u);
  EXPECT_EQ(OpenVideo(path, {.every_nth = 5}).value()->num_frames(), 3u);
  EXPECT_EQ(OpenVideo(path, {.first_frame = 2, .last_frame = 4}).value()->num_frames(), 3u);
}

// Matroska and MPEG streams state a duration and no number.
TEST_F(VideoSourceTest, NumberOfFramesIsExpectedFromTheDuration) {
  for (const auto& [name, codec] :
       {std::pair<std::string_view, std::string>{"a.mkv", "mpeg4"}, {"a.ts", "mpeg2video"}}) {
    const std::string path = WriteLevels(name, codec);
    EXPECT_EQ(OpenVideo(path, {}).value()->num_frames(), 12u) << name;
    EXPECT_EQ(OpenVideo(path, {.first_frame = 2, .every_nth = 5}).value()->num_frames(), 2u) << name;
    EXPECT_EQ(OpenVideo(path, {.first_frame = 40}).value()->num_frames(), 0u) << name;
  }
}

TEST_F(VideoSourceTest, OptionsChooseAPartAndHalve) {
  const std::string path = WriteLevels("a.mov", "mpeg4");
  const SequenceOptions options = {.first_frame = 2, .last_frame = 7, .every_nth = 3, .halve = true};
  Result<std::unique_ptr<FrameSource>> source = OpenVideo(path, options);
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->calibration().width_px, 32);
  EXPECT_EQ((*source)->calibration().rate_hz, OpenVideo(path, {}).value()->calibration().rate_hz / 3);
  for (std::uint32_t i = 0; i < 2; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->timestamp.time_since_epoch().count(), 40'000'000 * (2 + 3 * i));
    EXPECT_EQ((*source)->FrameName(i), "frame_00000" + std::to_string(2 + 3 * i) + ".png");
    EXPECT_EQ(frame->image.width, 32);
    EXPECT_EQ(frame->image.height, 24);
    EXPECT_NEAR(frame->image.row(12)[3 * 16], Expanded(LevelOf(2 + 3 * i)), 5.0);
  }
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
}

TEST_F(VideoSourceTest, OfWovenPicturesTheTopFieldIsShown) {
  Image woven(64, 48, PixelFormat::kGrey8);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) woven.row(y)[x] = (x + (y % 2) * 8) / 8 % 2 == 0 ? 60 : 180;
  }
  const std::string path = folder_.Path("woven.mkv");
  ASSERT_EQ(WriteVideo(path, "ffv1", 25, {woven, woven}), "");
  for (const bool halve : {false, true}) {
    const Frame frame = OpenVideo(path, {.halve = halve}).value()->Next(kNoDeadline).value();
    EXPECT_TRUE(frame.shows_one_field);
  }
  const auto source = OpenVideo(path, {}).value();
  const Frame frame = source->Next(kNoDeadline).value();
  EXPECT_EQ(frame.image.row(11)[3 * 9], frame.image.row(10)[3 * 9]);
  const auto as_stored = OpenVideo(path, {.deinterlace = DeinterlaceChoice::kOff}).value();
  const Frame off = as_stored->Next(kNoDeadline).value();
  EXPECT_FALSE(off.shows_one_field);
  EXPECT_NE(off.image.row(11)[3 * 9], off.image.row(10)[3 * 9]);
}

TEST_F(VideoSourceTest, EndomapperFolderIsFound) {
  std::filesystem::remove(folder_.Path("calib.yaml"));
  WriteLevels("Endoscope_01/Endoscope_01.mov", "mpeg4");
  folder_.Write("Endoscope_01/Endoscope_01_photometrical.xml", "<not read/>");
  folder_.Write(
      "Endoscope_01/Endoscope_01_geometrical.xml",
      "<rig><camera><camera_model name=\"\" index=\"0\" serialno=\"0\" type=\"calibu_fu_fv_u0_v0_kb4\" version=\"0\">"
      "<width> 64 </width><height> 48 </height><params> [ 35; 36; 31; 23; -0.13; -0.001; 0.0009; -0.00004 ] </params>"
      "</camera_model></camera></rig>");
  folder_.WriteImage("Endoscope_01/mask.png", FlatImage(64, 48, PixelFormat::kGrey8, 255));
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.Path("Endoscope_01"), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->calibration().fy, 36.0);
  EXPECT_EQ((*source)->calibration().rate_hz, 25.0);  // of the recording: a Calibu rig has none
  EXPECT_EQ((*source)->static_mask().width, 64);
  EXPECT_TRUE((*source)->Next(kNoDeadline).ok());
}

TEST_F(VideoSourceTest, EndomapperSequenceFindsTheCalibrationOfItsEndoscope) {
  std::filesystem::remove(folder_.Path("calib.yaml"));
  WriteLevels("Sequences/Seq_007/Seq_007.mov", "mpeg4");
  folder_.Write("Calibrations/Endoscope_03/Endoscope_03_geometrical.xml",
                "<rig><camera><camera_model type=\"calibu_fu_fv_u0_v0_kb4\"><width> 64 </width><height> 48 </height>"
                "<params> [ 35; 37; 31; 23; -0.13; -0.001; 0.0009; -0.00004 ] </params></camera_model></camera></rig>");
  // A number in some files, a text in others.
  for (const std::string_view number : {"3", "\"3\"", "\"03\""}) {
    folder_.Write("Sequences/Seq_007/Seq_007_info.json",
                  "{\n  \"video\": \"Seq_007\",\n  \"endoscope_number\": " + std::string(number) + "\n}\n");
    const Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.Path("Sequences/Seq_007"), {});
    ASSERT_TRUE(source.ok()) << source.status().ToString();
    EXPECT_EQ((*source)->calibration().fy, 37.0);
  }
  folder_.Write("Sequences/Seq_007/Seq_007_info.json", "{\"endoscope_number\": \"N/A\"}");
  EXPECT_THAT(OpenSequence(folder_.Path("Sequences/Seq_007"), {}).status().message(),
              HasSubstr("Seq_007_info.json:1: 'endoscope_number' is 'N/A': the endoscope was not recorded"));
  folder_.Write("Sequences/Seq_007/Seq_007_info.json", "{\"endoscope_number\": 12}");
  EXPECT_THAT(OpenSequence(folder_.Path("Sequences/Seq_007"), {}).status().message(),
              HasSubstr("Endoscope_12_geometrical.xml: no such file"));
}

TEST_F(VideoSourceTest, WhatGoesWithAVideoMustBeUnambiguous) {
  const std::string path = WriteLevels("a.mov", "mpeg4");
  folder_.Write("b_geometrical.xml", "<rig/>");
  folder_.Write("c_geometrical.xml", "<rig/>");
  EXPECT_THAT(OpenVideo(path, {}).status().message(), HasSubstr("more than one calibration"));
  std::filesystem::remove(folder_.Path("b_geometrical.xml"));
  std::filesystem::remove(folder_.Path("c_geometrical.xml"));
  std::filesystem::remove(folder_.Path("calib.yaml"));
  const Result<std::unique_ptr<FrameSource>> bare = OpenVideo(path, {});
  EXPECT_EQ(bare.code(), StatusCode::kNotFound);
  EXPECT_THAT(bare.status().message(), AllOf(HasSubstr("no camera calibration"), HasSubstr("a_geometrical.xml")));
  WriteLevels("b.mov", "mpeg4");
  EXPECT_THAT(OpenSequence(folder_.path(), {}).status().message(), HasSubstr("2 recordings (a.mov, b.mov, ..)"));
}

TEST_F(VideoSourceTest, FolderWithPicturesAndAVideoIsRefusedByBothNames) {
  const std::string path = WriteLevels("a.mp4", "mpeg4");
  folder_.WriteImage("mask.png", FlatImage(64, 48, PixelFormat::kGrey8, 255));
  EXPECT_TRUE(OpenSequence(folder_.path(), {}).ok()) << "a mask is no picture";
  folder_.WriteImage("000000.png", FlatImage(64, 48, PixelFormat::kGrey8, 90));
  folder_.WriteImage("000001.png", FlatImage(64, 48, PixelFormat::kGrey8, 91));
  const Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  EXPECT_EQ(source.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(source.status().message(), HasSubstr("holds a video (a.mp4) and pictures (2, the first is 000000.png)"));
  EXPECT_TRUE(OpenSequence(path, {}).ok()) << "it is named itself";
  // What is in frames/ are the pictures that are meant.
  std::filesystem::create_directory(folder_.Path("frames"));
  for (const char* name : {"000000.png", "000001.png"}) {
    std::filesystem::rename(folder_.Path(name), folder_.Path(std::string("frames/") + name));
  }
  folder_.Write("times.txt", "0\n0.04\n");
  const Result<std::unique_ptr<FrameSource>> pictures = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(pictures.ok()) << pictures.status().ToString();
  EXPECT_EQ((*pictures)->num_frames(), 2u);
}

TEST_F(VideoSourceTest, VideoThatDoesNotFitTheCalibrationIsRefused) {
  const std::string path = WriteLevels("a.mov", "mpeg4");
  folder_.Write("calib.yaml", Replaced(kSmallCalibration, "Camera.width: 64", "Camera.width: 128"));
  const Result<std::unique_ptr<FrameSource>> source = OpenVideo(path, {});
  EXPECT_EQ(source.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(source.status().message(), HasSubstr("a.mov: the video is 64x48, the calibration"));
}

TEST_F(VideoSourceTest, FileThatIsNoVideoIsDataLoss) {
  const Result<std::unique_ptr<FrameSource>> text = OpenVideo(folder_.Write("a.mov", "not a video"), {});
  EXPECT_EQ(text.code(), StatusCode::kDataLoss);
  EXPECT_THAT(text.status().message(), HasSubstr("a.mov: cannot be opened as a video"));
  EXPECT_EQ(OpenVideo(folder_.Write("empty.mp4", ""), {}).code(), StatusCode::kDataLoss);
  EXPECT_EQ(OpenVideo(folder_.Path("no.mp4"), {}).code(), StatusCode::kNotFound);
}

// libav would open what such a list names, other files and addresses of the network among them.
TEST_F(VideoSourceTest, ListOfOtherFilesIsNoVideo) {
  WriteLevels("whole.mkv", "mpeg4");
  const std::string concat = folder_.Write("a.mkv", "ffconcat version 1.0\nfile whole.mkv\n");
  const std::string playlist = folder_.Write(
      "b.mkv", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n" + folder_.Path("whole.mkv") + "\n#EXT-X-ENDLIST\n");
  for (const std::string& path : {concat, playlist}) {
    const Result<std::unique_ptr<FrameSource>> source = OpenVideo(path, {});
    EXPECT_EQ(source.code(), StatusCode::kDataLoss);
    EXPECT_THAT(source.status().message(), HasSubstr("cannot be opened as a video (mov, mp4, avi, mkv"));
  }
}

// Recorders write these, too, and people rename files.
TEST_F(VideoSourceTest, TheContentSaysWhichContainerItIs) {
  for (const auto& [name, codec] : {std::pair<std::string_view, std::string>{"a.mpg", "mpeg2video"},
                                    {"a.vob", "mpeg2video"},
                                    {"a.ts", "mpeg2video"},
                                    {"a.wmv", "mpeg4"}}) {
    std::filesystem::rename(WriteLevels(name, codec), folder_.Path("clip"));
    Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.Path("clip"), {});
    ASSERT_TRUE(source.ok()) << name << ": " << source.status().ToString();
    for (std::uint32_t i = 0; i < kNumFrames; ++i) {
      const Result<Frame> frame = (*source)->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok()) << name << ": " << frame.status().ToString();
      EXPECT_EQ(frame->index, i);
      EXPECT_EQ(frame->timestamp.time_since_epoch().count(), 40'000'000 * i) << name;
      EXPECT_NEAR(frame->image.row(24)[3 * 32], Expanded(LevelOf(i)), 5.0) << name;
    }
    EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
  }
  const Result<std::unique_ptr<FrameSource>> text = OpenSequence(folder_.Write("notes.txt", "not a video"), {});
  EXPECT_EQ(text.code(), StatusCode::kDataLoss);
  EXPECT_THAT(text.status().message(), HasSubstr("notes.txt: cannot be opened as a video"));
}

TEST_F(VideoSourceTest, FrameRateIsRefused) {
  const Status status = OpenVideo(WriteLevels("a.mov", "mpeg4"), {.frame_rate_hz = 25.0}).status();
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("a.mov: states the times of its frames"));
}

TEST_F(VideoSourceTest, RecordingThatBreaksOffGivesWhatIsThere) {
  WriteLevels("a.mkv", "mpeg4");
  const std::string bytes = folder_.Read("a.mkv");
  const std::string path = folder_.Write("cut.mkv", bytes.substr(0, bytes.size() * 2 / 3));
  Result<std::unique_ptr<FrameSource>> source = OpenVideo(path, {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  int num_good = 0;
  for (int i = 0; i < 100; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) break;
    num_good += frame.ok() ? 1 : 0;
  }
  EXPECT_GE(num_good, 2);
  EXPECT_LT(num_good, kNumFrames);
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
}

// Two recordings in one file, as `cat` joins them: the times of the second begin again.
TEST_F(VideoSourceTest, JoinedRecordingsGoOnAtTheRateOfTheStream) {
  constexpr std::uint32_t kNumOfEach = 50;
  std::vector<Image> frames;
  for (std::uint32_t i = 0; i < kNumOfEach; ++i) {
    frames.push_back(FlatImage(64, 48, PixelFormat::kGrey8, static_cast<std::uint8_t>(30 + 3 * i)));
  }
  ASSERT_EQ(WriteVideo(folder_.Path("part.ts"), "mpeg2video", 25, frames), "");
  const std::string part = folder_.Read("part.ts");
  Result<std::unique_ptr<FrameSource>> source = OpenVideo(folder_.Write("joined.ts", part + part), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  for (std::uint32_t i = 0; i < 2 * kNumOfEach; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->timestamp.time_since_epoch().count(), 40'000'000 * i);
    EXPECT_NEAR(frame->image.row(24)[3 * 32], Expanded(30 + 3 * static_cast<int>(i % kNumOfEach)), 5.0);
    EXPECT_EQ(StampRemark(**source).empty(), i < kNumOfEach) << i;
    EXPECT_EQ(frame->refused_stamp, i == kNumOfEach ? std::optional(TimePoint()) : std::nullopt) << i;
  }
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
  EXPECT_THAT(StampRemark(**source), AllOf(HasSubstr("joined.ts"), HasSubstr("jump once, at frame 50")));
}

// The other way round: the second recording's clock is hours ahead.
TEST_F(VideoSourceTest, TimesThatJumpFarAheadGoOnAtTheRateOfTheStream) {
  std::vector<Image> frames;
  for (int i = 0; i < 10; ++i) frames.push_back(FlatImage(64, 48, PixelFormat::kGrey8, 90));
  const std::string path = folder_.Path("a.mkv");
  for (const auto& [gap_s, shown_s] : {std::pair{6, 6.0}, std::pair{7200, 0.04}}) {
    ASSERT_EQ(WriteVideo(path, "mpeg4", 25, frames, {.frame = 5, .gap_s = gap_s}), "");
    Result<std::unique_ptr<FrameSource>> source = OpenVideo(path, {});
    ASSERT_TRUE(source.ok()) << source.status().ToString();
    TimePoint before;
    for (std::uint32_t i = 0; i < 10; ++i) {
      const Result<Frame> frame = (*source)->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok()) << frame.status().ToString();
      const double expected_s = i == 5 ? shown_s : 0.04;
      if (i > 0) {
        EXPECT_NEAR(ToSeconds(frame->timestamp - before), expected_s, 0.002) << gap_s << " " << i;
      }
      before = frame->timestamp;
    }
    EXPECT_EQ(StampRemark(**source).empty(), gap_s == 6);
  }
}

TEST_F(VideoSourceTest, DamagedRecordingsEndAndKeepTimesIncreasing) {
  std::mt19937 random(3);
  for (const auto& [name, codec] :
       {std::pair<std::string_view, std::string>{"whole.mov", "mpeg4"}, {"whole.avi", "mjpeg"}}) {
    WriteLevels(name, codec);
    const std::string original = folder_.Read(name);
    for (int trial = 0; trial < 60; ++trial) {
      std::string bytes = original;
      for (int flip = 0; flip < 8; ++flip) bytes[random() % bytes.size()] = static_cast<char>(random());
      Result<std::unique_ptr<FrameSource>> source =
          OpenVideo(folder_.Write("flipped" + std::string(name.substr(5)), bytes), {});
      if (!source.ok()) continue;
      std::int64_t last_ns = -1;
      for (int i = 0; i < 1000; ++i) {
        const Result<Frame> frame = (*source)->Next(kNoDeadline);
        if (frame.code() == StatusCode::kNotFound) break;
        ASSERT_LT(i, 999) << "no end";
        if (!frame.ok()) {
          ASSERT_EQ(frame.code(), StatusCode::kDataLoss);
          continue;
        }
        ASSERT_GT(frame->timestamp.time_since_epoch().count(), last_ns);
        last_ns = frame->timestamp.time_since_epoch().count();
      }
    }
  }
}

}  // namespace
}  // namespace haustra
