// Each published layout on a small folder that the test writes itself.
#include "capture/open_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include <cmath>

#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// The first pixel and the time stamp of every frame.
struct ReadFrames {
  std::vector<int> values;
  std::vector<std::int64_t> timestamps_ns;
};

ReadFrames ReadSequence(FrameSource* source) {
  ReadFrames seen;
  for (;;) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) return seen;
    if (!frame.ok()) {
      ADD_FAILURE() << frame.status().ToString();
      return seen;
    }
    seen.values.push_back(frame->image.row(0)[0]);
    seen.timestamps_ns.push_back(frame->timestamp.time_since_epoch().count());
  }
}

class OpenSequenceTest : public ::testing::Test {
 protected:
  void WriteFlat(std::string_view name, std::uint8_t value) {
    folder_.WriteImage(name, FlatImage(64, 48, PixelFormat::kGrey8, value));
  }
  std::string OpenError(StatusCode code, const std::string& path) {
    const Result<std::unique_ptr<FrameSource>> source = OpenSequence(path, {});
    EXPECT_EQ(source.code(), code) << source.status().ToString();
    return source.status().message();
  }

  TempFolder folder_;
};

TEST_F(OpenSequenceTest, OwnLayoutIsFound) {
  WriteFlat("frames/000000.png", 7);
  WriteFlat("frames/000001.jpg", 9);
  folder_.Write("calib.yaml", kSmallCalibration);
  folder_.Write("times.txt", "0\n0.04\n");
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_THAT(ReadSequence(source->get()).values, ElementsAre(7, 9));
}

// In a folder a video is told by its name alone; named itself it is told by what it holds.
TEST_F(OpenSequenceTest, FolderWithAFileOfAnotherNameSaysHowAVideoIsNamed) {
  folder_.Write("procedure/video", "bytes of a video");
  EXPECT_THAT(
      OpenError(StatusCode::kInvalidArgument, folder_.Path("procedure")),
      AllOf(HasSubstr("procedure: not a sequence that is known here"), HasSubstr(".m4v"),
            HasSubstr("a video whose name ends otherwise is named itself: " + folder_.Path("procedure/video"))));
  std::filesystem::create_directories(folder_.Path("empty.mp4"));
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.Path("empty.mp4")),
              ::testing::Not(HasSubstr("named itself")));
}

TEST_F(OpenSequenceTest, FolderWithTheNameOfAVideoIsAFolder) {
  WriteFlat("clip.mp4/a.png", 7);
  folder_.Write("clip.mp4/calib.yaml", kSmallCalibration);
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.Path("clip.mp4"), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_THAT(ReadSequence(source->get()).values, ElementsAre(7));
}

// A frame whose time is missing, as the last one of a cut recording, would move all times after it.
TEST_F(OpenSequenceTest, CutRecordingHasTheTimesThatWereStoredWhateverTheRate) {
  for (const char* name : {"frames/000003.png", "frames/000005.png", "frames/000009.png"}) WriteFlat(name, 7);
  folder_.Write("calib.yaml", kSmallCalibration);
  folder_.Write("times.recording", "000009.png 12.5\n000003.png 12.25\n000006.png 12.3\n");
  const Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_THAT(ReadSequence(source->get()).timestamps_ns, ElementsAre(0, 250'000'000));

  folder_.Write("times.recording", "000009.png 12.5\n000003.png soon\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("times.recording:2"));
  folder_.Write("times.recording", "000003.png 12.25\n000009.png 12.25\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("000009.png"));
  folder_.Write("times.recording", "");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("cut before its first frame"));
}

TEST_F(OpenSequenceTest, FolderThatMayNotBeReadIsUnavailable) {
  if (geteuid() == 0) GTEST_SKIP() << "root may read everything";
  WriteFlat("closed/below/000000.png", 7);
  std::filesystem::permissions(folder_.Path("closed"), std::filesystem::perms::none);
  EXPECT_THAT(OpenError(StatusCode::kUnavailable, folder_.Path("closed")), HasSubstr("Permission denied"));
  EXPECT_THAT(OpenError(StatusCode::kUnavailable, folder_.Path("closed/below")), HasSubstr("Permission denied"));
  std::filesystem::permissions(folder_.Path("closed"), std::filesystem::perms::owner_all);
}

TEST_F(OpenSequenceTest, ImagesInTheFolderItselfAreFound) {
  WriteFlat("2.png", 2);
  WriteFlat("10.png", 10);
  folder_.WriteImage("mask.png", FlatImage(64, 48, PixelFormat::kGrey8, 255));
  folder_.Write("calib.yaml", kSmallCalibration);
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  const ReadFrames seen = ReadSequence(source->get());
  EXPECT_THAT(seen.values, ElementsAre(2, 10));
  EXPECT_THAT(seen.timestamps_ns, ElementsAre(0, 40'000'000));
}

// A folder as other programs leave it: no times, no calibration, something else beside the pictures.
TEST_F(OpenSequenceTest, BarePicturesAreReadAtTheFrameRateThatIsNamed) {
  for (const int i : {9, 10, 100}) WriteFlat("shot " + std::to_string(i) + ".png", static_cast<std::uint8_t>(i));
  folder_.Write("notes.txt", "not read");
  SequenceOptions options;
  options.calibration = CameraCalibration{};
  const Status without = OpenSequence(folder_.path(), options).status();
  EXPECT_EQ(without.code(), StatusCode::kNotFound);
  EXPECT_THAT(without.message(), AllOf(HasSubstr("times.txt: no such file"), HasSubstr("give --frame-rate")));
  options.frame_rate_hz = 12.5;
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), options);
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->calibration().rate_hz, 12.5);
  const ReadFrames seen = ReadSequence(source->get());
  EXPECT_THAT(seen.values, ElementsAre(9, 10, 100));
  EXPECT_THAT(seen.timestamps_ns, ElementsAre(0, 80'000'000, 160'000'000));
}

TEST_F(OpenSequenceTest, FrameRateGoesBeforeThatOfTheCalibrationAndNotBeforeTimes) {
  for (const int i : {0, 1}) WriteFlat(std::to_string(i) + ".png", static_cast<std::uint8_t>(i));
  folder_.Write("calib.yaml", kSmallCalibration);
  SequenceOptions options;
  options.frame_rate_hz = 50.0;
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), options);
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_THAT(ReadSequence(source->get()).timestamps_ns, ElementsAre(0, 20'000'000));
  folder_.Write("times.txt", "0\n1\n");
  const Status timed = OpenSequence(folder_.path(), options).status();
  EXPECT_EQ(timed.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(timed.message(), HasSubstr("times.txt: states the times of its frames"));
  WriteFlat("0_color.png", 0);
  EXPECT_EQ(OpenSequence(folder_.path(), options).code(), StatusCode::kInvalidArgument) << "C3VD";
  EXPECT_EQ(OpenSequence("v4l2:/dev/video0", options).code(), StatusCode::kInvalidArgument);
  for (const double bad : {-1.0, std::nan("")}) {
    options.frame_rate_hz = bad;
    EXPECT_THAT(options.Validate().message(), HasSubstr("the frame rate is"));
  }
}

TEST(SequenceOptions, IndexOfAFrameIsFoundAgain) {
  const SequenceOptions part = {.first_frame = 10, .last_frame = 20, .every_nth = 3};
  EXPECT_EQ(part.StoredFrame(2), 16u);
  EXPECT_EQ(part.IndexOf(16), 2u);
  EXPECT_EQ(part.IndexOf(10), 0u);
  for (const std::uint32_t not_read : {0u, 7u, 9u, 11u, 17u, 22u}) EXPECT_EQ(part.IndexOf(not_read), std::nullopt);
  EXPECT_EQ(SequenceOptions{}.IndexOf(5), 5u);
}

TEST_F(OpenSequenceTest, C3vdIsFoundAndOrderedByNumber) {
  for (const int i : {0, 1, 2, 9, 10, 11}) WriteFlat(std::to_string(i) + "_color.png", static_cast<std::uint8_t>(i));
  WriteFlat("0000_occlusion.png", 200);
  folder_.Write("0000_depth.tiff", "not read");
  folder_.Write("pose.txt", "not read");
  folder_.Write("calib.yaml", Replaced(kSmallCalibration, "Camera.fps: 25\n", ""));
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->num_frames(), 6u);
  EXPECT_EQ((*source)->calibration().rate_hz, 29.97);
  EXPECT_EQ((*source)->FrameName(3), "9_color.png");
  const ReadFrames seen = ReadSequence(source->get());
  EXPECT_THAT(seen.values, ElementsAre(0, 1, 2, 9, 10, 11));
  // N / 29.97 s: a number that is missing leaves its time free.
  EXPECT_THAT(seen.timestamps_ns, ElementsAre(0, 33'366'700, 66'733'400, 300'300'300, 333'667'000, 367'033'700));
}

TEST_F(OpenSequenceTest, C3vdWithoutCalibrationNamesThePresets) {
  WriteFlat("0_color.png", 0);
  EXPECT_THAT(OpenError(StatusCode::kNotFound, folder_.path()), HasSubstr("config/cameras/c3vd_v1_*.yaml"));
}

TEST_F(OpenSequenceTest, C3vdFrameThatIsThereTwiceIsRefused) {
  WriteFlat("1_color.png", 0);
  WriteFlat("0001_color.png", 0);
  folder_.Write("calib.yaml", kSmallCalibration);
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("frame 1 is there twice"));
}

TEST_F(OpenSequenceTest, EurocIsFound) {
  folder_.Write("mav0/cam0/data.csv",
                "#timestamp [ns],filename\r\n"
                "1403636579763555584,1403636579763555584.png\r\n"
                "1403636579813555456,1403636579813555456.png\r\n");
  folder_.Write("mav0/cam0/sensor.yaml",
                "sensor_type: camera\nrate_hz: 20\nresolution: [64, 48]\ncamera_model: pinhole\n"
                "intrinsics: [40, 41, 31, 24]\ndistortion_model: radial-tangential\n"
                "distortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]\n");
  WriteFlat("mav0/cam0/data/1403636579763555584.png", 3);
  WriteFlat("mav0/cam0/data/1403636579813555456.png", 5);
  for (const std::string& path : {folder_.path(), folder_.Path("mav0")}) {
    Result<std::unique_ptr<FrameSource>> source = OpenSequence(path, {});
    ASSERT_TRUE(source.ok()) << source.status().ToString();
    EXPECT_EQ((*source)->calibration().kind, CameraModelKind::kPinhole);
    EXPECT_EQ((*source)->calibration().rate_hz, 20.0);
    EXPECT_EQ((*source)->FrameName(1), "1403636579813555456.png");
    const ReadFrames seen = ReadSequence(source->get());
    EXPECT_THAT(seen.values, ElementsAre(3, 5));
    EXPECT_THAT(seen.timestamps_ns, ElementsAre(1403636579763555584, 1403636579813555456));
  }
}

TEST_F(OpenSequenceTest, EurocListWithAMistakeIsRefusedWithItsLine) {
  folder_.Write("mav0/cam0/data.csv", "#timestamp [ns],filename\n100,a.png\n90,b.png\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("data.csv:3: time stamp"));
  folder_.Write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1e3,a.png\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()),
              HasSubstr("data.csv:2: '1e3' is not a whole number"));
  folder_.Write("mav0/cam0/data.csv", "#timestamp [ns],filename\n100\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("data.csv:2: not a time"));
  folder_.Write("mav0/cam0/data.csv", "#timestamp [ns],filename\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("the sequence is empty"));
}

TEST_F(OpenSequenceTest, TumIsFound) {
  folder_.Write("rgb.txt",
                "# color images\n# file: 'rgbd_dataset_freiburg1_xyz.bag'\n# timestamp filename\n"
                "1305031102.175304 rgb/1305031102.175304.png\n1305031102.211214 rgb/1305031102.211214.png\n");
  WriteFlat("rgb/1305031102.175304.png", 21);
  WriteFlat("rgb/1305031102.211214.png", 22);
  folder_.Write("calib.yaml", kSmallCalibration);
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  const ReadFrames seen = ReadSequence(source->get());
  EXPECT_THAT(seen.values, ElementsAre(21, 22));
  EXPECT_THAT(seen.timestamps_ns, ElementsAre(1305031102175304000, 1305031102211214000));
  EXPECT_EQ((*source)->FrameName(0), "1305031102.175304.png");
}

TEST_F(OpenSequenceTest, NamesBeginBelowTheFolderThatHoldsAllPictures) {
  folder_.Write("rgb.txt", "1.0 day/rgb/a.png\n2.0 day/rgb2/a.png\n");
  WriteFlat("day/rgb/a.png", 21);
  WriteFlat("day/rgb2/a.png", 22);
  folder_.Write("calib.yaml", kSmallCalibration);
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->FrameName(0), "rgb/a.png");
  EXPECT_EQ((*source)->FrameName(1), "rgb2/a.png");
}

TEST_F(OpenSequenceTest, TumListWithAMistakeIsRefusedWithItsLine) {
  folder_.Write("calib.yaml", kSmallCalibration);
  folder_.Write("rgb.txt", "1.0 a.png\n1.0 b.png\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()),
              HasSubstr("rgb.txt:2: time stamp 1.000000000 s repeats"));
  folder_.Write("rgb.txt", "1.0 a.png b.png\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("rgb.txt:1: not a time in seconds"));
  folder_.Write("rgb.txt", "# nothing\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()), HasSubstr("the sequence is empty"));
}

TEST_F(OpenSequenceTest, ListedImageThatIsMissingIsOneLostFrame) {
  folder_.Write("calib.yaml", kSmallCalibration);
  folder_.Write("rgb.txt", "1.0 a.png\n2.0 b.png\n");
  WriteFlat("a.png", 1);
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_TRUE((*source)->Next(kNoDeadline).ok());
  const Result<Frame> lost = (*source)->Next(kNoDeadline);
  EXPECT_EQ(lost.code(), StatusCode::kDataLoss);
  EXPECT_THAT(lost.status().message(), HasSubstr("b.png: no such file"));
}

TEST_F(OpenSequenceTest, UnknownLayoutSaysWhatWasLookedFor) {
  folder_.Write("readme.txt", "nothing");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, folder_.path()),
              AllOf(HasSubstr("frames/"), HasSubstr("N_color.png"), HasSubstr("data.csv"), HasSubstr("rgb.txt"),
                    HasSubstr(".mov")));
}

TEST_F(OpenSequenceTest, MissingPathAndOtherFilesAreRefused) {
  EXPECT_THAT(OpenError(StatusCode::kNotFound, folder_.Path("no")), HasSubstr("no: no such file or folder"));
  // Of a build without video, too.
  EXPECT_THAT(OpenSequence(folder_.Write("a.txt", "x"), {}).status().message(), HasSubstr("video"));
}

TEST_F(OpenSequenceTest, OptionsAreChecked) {
  const Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_.path(), {.every_nth = 0});
  EXPECT_EQ(source.code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace haustra
