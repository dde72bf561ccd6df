#include "capture/image_folder_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class ImageFolderSourceTest : public ::testing::Test {
 protected:
  // Five frames of 64x48 at 25 Hz; all pixels of frame i are 10 i.
  ImageFolderSourceTest() {
    for (int i = 0; i < 5; ++i)
      WriteFrame(i, FlatImage(64, 48, PixelFormat::kGrey8, static_cast<std::uint8_t>(10 * i)));
    folder_.Write("calib.yaml", kSmallCalibration);
    folder_.Write("times.txt", "0.000000\n0.040000\n0.080000\n0.120000\n0.160000\n");
  }

  static std::string FrameName(int i) { return "frames/00000" + std::to_string(i) + ".png"; }
  void WriteFrame(int i, const Image& image) { folder_.WriteImage(FrameName(i), image); }
  Result<std::unique_ptr<FrameSource>> Open(const SequenceOptions& options = {}) {
    return OpenImageFolder(folder_.path(), options);
  }
  // Expects an error and returns its message.
  std::string OpenError(StatusCode code, const SequenceOptions& options = {}) {
    const Result<std::unique_ptr<FrameSource>> source = Open(options);
    EXPECT_EQ(source.code(), code) << source.status().ToString();
    return source.status().message();
  }

  TempFolder folder_;
};

TEST_F(ImageFolderSourceTest, GivesAllFramesInOrder) {
  Result<std::unique_ptr<FrameSource>> source = Open();
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->num_frames(), 5u);
  EXPECT_EQ((*source)->calibration().fx, 40.5);
  EXPECT_TRUE((*source)->static_mask().is_empty());
  for (std::uint32_t i = 0; i < 5; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->timestamp.time_since_epoch().count(), 40'000'000 * i);
    EXPECT_EQ(frame->image.width, 64);
    EXPECT_EQ(frame->image.height, 48);
    EXPECT_EQ(frame->image.row(47)[63], 10 * i);
  }
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
}

TEST_F(ImageFolderSourceTest, OptionsChooseAPartAndEveryNth) {
  const SequenceOptions options = {.first_frame = 1, .last_frame = 4, .every_nth = 2};
  Result<std::unique_ptr<FrameSource>> source = Open(options);
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->num_frames(), 2u);
  // A session gives a frame as long as it takes until the next one comes.
  EXPECT_EQ((*source)->calibration().rate_hz, Open().value()->calibration().rate_hz / 2);
  const Frame first = (*source)->Next(kNoDeadline).value();
  EXPECT_EQ(first.index, 0u);
  EXPECT_EQ(first.image.row(0)[0], 10);
  const Frame second = (*source)->Next(kNoDeadline).value();
  EXPECT_EQ(second.index, 1u);
  EXPECT_EQ(second.image.row(0)[0], 30);
  EXPECT_EQ(second.timestamp.time_since_epoch().count(), 120'000'000);
  EXPECT_EQ((*source)->FrameName(0), "000001.png");
  EXPECT_EQ((*source)->FrameName(1), "000003.png");
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
}

TEST_F(ImageFolderSourceTest, ReversedItRunsFromTheLastToTheFirstWithTimeRunningOn) {
  folder_.Write("times.txt", "0.000000\n0.040000\n0.090000\n0.120000\n0.160000\n");
  Result<std::unique_ptr<FrameSource>> source = Open({.first_frame = 1, .every_nth = 1, .reversed = true});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  // Frames 4, 3, 2, 1, and the times of 1 to 4 mirrored.
  const std::int64_t stamps_ms[] = {40, 80, 110, 160};
  for (std::uint32_t i = 0; i < 4; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->timestamp.time_since_epoch().count(), 1'000'000 * stamps_ms[i]);
    EXPECT_EQ(frame->image.row(0)[0], 10 * (4 - i));
    EXPECT_EQ((*source)->FrameName(i), "00000" + std::to_string(4 - i) + ".png");
  }
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
}

TEST_F(ImageFolderSourceTest, HalvingHalvesFramesMaskAndCalibration) {
  Image mask = FlatImage(64, 48, PixelFormat::kGrey8, 255);
  mask.row(0)[1] = 0;
  folder_.WriteImage("mask.png", mask);
  WriteFrame(0, RampImage(64, 48, PixelFormat::kBgr8));
  Result<std::unique_ptr<FrameSource>> source = Open({.halve = true});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->calibration().width_px, 32);
  EXPECT_EQ((*source)->calibration().height_px, 24);
  EXPECT_EQ((*source)->calibration().fx, 20.25);
  EXPECT_EQ((*source)->calibration().cx, (31.5 + 0.5) / 2 - 0.5);
  EXPECT_EQ((*source)->static_mask().width, 32);
  EXPECT_EQ((*source)->static_mask().row(0)[0], 0);
  EXPECT_EQ((*source)->static_mask().row(0)[1], 255);
  const Frame frame = (*source)->Next(kNoDeadline).value();
  EXPECT_EQ(frame.image.width, 32);
  EXPECT_EQ(frame.image.height, 24);
  // Values 2 x + y + 40 c over the block at (10, 6): mean 2 * 10.5 + 6.5 + 40 c = 27.5 + 40 c, rounded up.
  EXPECT_EQ(frame.image.row(3)[5 * 3 + 0], 28);
  EXPECT_EQ(frame.image.row(3)[5 * 3 + 2], 108);
}

// Rows of stripes that move by half their width from one field to the next.
Image WovenImage() {
  Image image(64, 48, PixelFormat::kGrey8);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) image.row(y)[x] = (x + (y % 2) * 8) / 8 % 2 == 0 ? 60 : 180;
  }
  return image;
}

TEST_F(ImageFolderSourceTest, OfAWovenPictureTheTopFieldIsShownAndOfAllThatFollow) {
  for (const int i : {0, 2, 3}) WriteFrame(i, WovenImage());
  const Image progressive = RampImage(64, 48, PixelFormat::kGrey8);
  WriteFrame(1, progressive);
  WriteFrame(4, progressive);
  for (const bool reversed : {false, true}) {
    Result<std::unique_ptr<FrameSource>> source = Open({.reversed = reversed});
    ASSERT_TRUE(source.ok()) << source.status().ToString();
    for (int i = 0; i < 5; ++i) {
      const Frame frame = (*source)->Next(kNoDeadline).value();
      // From the end, the progressive one comes first and is not known to be of an interlaced source.
      EXPECT_EQ(frame.shows_one_field, !reversed || i != 0) << i;
      const bool is_woven = reversed ? i == 1 || i == 2 || i == 4 : i != 1 && i != 4;
      if (is_woven) {
        EXPECT_EQ(frame.image.row(11)[9], frame.image.row(10)[9]) << i;
      }
    }
  }
  Result<std::unique_ptr<FrameSource>> source = Open({.deinterlace = DeinterlaceChoice::kOff});
  const Frame off = (*source)->Next(kNoDeadline).value();
  EXPECT_FALSE(off.shows_one_field);
  EXPECT_EQ(PixelsOf(off.image), PixelsOf(WovenImage().view()));
  source = Open({.first_frame = 1, .deinterlace = DeinterlaceChoice::kOn});
  const Frame on = (*source)->Next(kNoDeadline).value();
  EXPECT_TRUE(on.shows_one_field);
  EXPECT_EQ(on.image.row(47)[5], progressive.row(46)[5]);
}

TEST_F(ImageFolderSourceTest, FieldsAreTakenApartBeforeHalving) {
  WriteFrame(0, WovenImage());
  Result<std::unique_ptr<FrameSource>> source = Open({.halve = true});
  const Frame frame = (*source)->Next(kNoDeadline).value();
  EXPECT_TRUE(frame.shows_one_field);
  EXPECT_EQ(frame.image.width, 32);
  // Halved as woven it would be grey all over.
  EXPECT_EQ(frame.image.row(5)[1], 60);
  EXPECT_EQ(frame.image.row(5)[5], 180);
}

TEST_F(ImageFolderSourceTest, ColourCanBeReadAsGrey) {
  WriteFrame(0, RampImage(64, 48, PixelFormat::kBgr8));
  Result<std::unique_ptr<FrameSource>> source = Open({.channels = ChannelChoice::kGrey});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->Next(kNoDeadline).value().image.format, PixelFormat::kGrey8);
}

TEST_F(ImageFolderSourceTest, MaskIsBinarised) {
  Image mask = FlatImage(64, 48, PixelFormat::kGrey8, 254);
  mask.row(5)[7] = 3;
  folder_.WriteImage("mask.png", mask);
  Result<std::unique_ptr<FrameSource>> source = Open();
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->static_mask().row(5)[6], 255);
  EXPECT_EQ((*source)->static_mask().row(5)[7], 0);
}

TEST_F(ImageFolderSourceTest, BrokenImageInTheMiddleIsOneLostFrame) {
  folder_.Write(FrameName(2), folder_.Read(FrameName(2)).substr(0, 60));
  Result<std::unique_ptr<FrameSource>> source = Open();
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  ASSERT_TRUE((*source)->Next(kNoDeadline).ok());
  ASSERT_TRUE((*source)->Next(kNoDeadline).ok());
  const Result<Frame> broken = (*source)->Next(kNoDeadline);
  EXPECT_EQ(broken.code(), StatusCode::kDataLoss);
  EXPECT_THAT(broken.status().message(), AllOf(HasSubstr("frames/000002.png"), HasSubstr("damaged PNG")));
  const Frame after = (*source)->Next(kNoDeadline).value();
  EXPECT_EQ(after.index, 3u);
  EXPECT_EQ(after.timestamp.time_since_epoch().count(), 120'000'000);
}

TEST_F(ImageFolderSourceTest, ImageOfAnotherSizeInTheMiddleIsOneLostFrame) {
  WriteFrame(1, FlatImage(32, 24, PixelFormat::kGrey8, 1));
  Result<std::unique_ptr<FrameSource>> source = Open();
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  ASSERT_TRUE((*source)->Next(kNoDeadline).ok());
  const Result<Frame> odd = (*source)->Next(kNoDeadline);
  EXPECT_EQ(odd.code(), StatusCode::kDataLoss);
  EXPECT_THAT(odd.status().message(), HasSubstr("000001.png: the image is 32x24"));
  EXPECT_TRUE((*source)->Next(kNoDeadline).ok());
}

TEST_F(ImageFolderSourceTest, ImageThatVanishesIsOneLostFrame) {
  Result<std::unique_ptr<FrameSource>> source = Open();
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  std::filesystem::remove(folder_.Path(FrameName(0)));
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kDataLoss);
  EXPECT_EQ((*source)->Next(kNoDeadline).value().index, 1u);
}

TEST_F(ImageFolderSourceTest, BrokenFirstImageDoesNotKeepTheSequenceFromOpening) {
  folder_.Write(FrameName(0), "not an image");
  Result<std::unique_ptr<FrameSource>> source = Open();
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kDataLoss);
  EXPECT_TRUE((*source)->Next(kNoDeadline).ok());
}

TEST_F(ImageFolderSourceTest, NothingButBrokenImagesIsDataLoss) {
  for (int i = 0; i < 5; ++i) folder_.Write(FrameName(i), "not an image");
  EXPECT_THAT(OpenError(StatusCode::kDataLoss), AllOf(HasSubstr("not one image can be read"), HasSubstr("000000.png")));
}

TEST_F(ImageFolderSourceTest, FramesThatDoNotFitTheCalibrationAreRefused) {
  folder_.Write("calib.yaml", Replaced(kSmallCalibration, "Camera.width: 64", "Camera.width: 128"));
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument),
              AllOf(HasSubstr("000000.png: the image is 64x48"), HasSubstr("calib.yaml) is for 128x48")));
}

TEST_F(ImageFolderSourceTest, MaskThatDoesNotFitIsRefused) {
  folder_.WriteImage("mask.png", FlatImage(32, 24, PixelFormat::kGrey8, 255));
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("mask.png: the mask is 32x24, the calibration 64x48"));
  folder_.WriteImage("mask.png", FlatImage(64, 48, PixelFormat::kGrey8, 0));
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("leaves nothing of the image"));
}

// A picture of the scene, or one that was never made black and white.
TEST_F(ImageFolderSourceTest, MaskThatIsAPictureIsRefusedAndGreyEdgesAreNot) {
  Image mask = FlatImage(64, 48, PixelFormat::kGrey8, 255);
  const auto paint_rows = [&mask](int first, int last, int value) {
    for (int y = first; y <= last; ++y) std::memset(mask.row(y), value, 64);
  };
  paint_rows(0, 9, 3);
  paint_rows(10, 18, 100);
  folder_.WriteImage("mask.png", mask);
  ASSERT_TRUE(Open().ok()) << Open().status().ToString();
  paint_rows(19, 19, 130);
  folder_.WriteImage("mask.png", mask);
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument),
              HasSubstr("mask.png: 20.8 % of it is grey, not black or white (at most 20 %)"));
}

// As other programs write them: 128 or 200 instead of 255, or painted green in colour.
TEST_F(ImageFolderSourceTest, MaskOfTwoOtherLevelsIsReadAndARampToAsMuchIsNot) {
  for (const int inside : {128, 150, 200}) {
    Image mask = FlatImage(64, 48, PixelFormat::kGrey8, static_cast<std::uint8_t>(inside));
    std::memset(mask.row(0), 0, 64);
    folder_.WriteImage("mask.png", mask);
    const Result<std::unique_ptr<FrameSource>> source = Open();
    ASSERT_TRUE(source.ok()) << source.status().ToString();
    ASSERT_FALSE((*source)->static_mask().is_empty());
    EXPECT_EQ((*source)->static_mask().row(0)[5], 0);
    EXPECT_EQ((*source)->static_mask().row(1)[5], 255);
    for (int y = 0; y < 48; ++y) {
      for (int x = 0; x < 64; ++x) mask.row(y)[x] = static_cast<std::uint8_t>(inside * x / 63);
    }
    folder_.WriteImage("mask.png", mask);
    EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("no mask, a picture?"));
  }
  Image green = FlatImage(64, 48, PixelFormat::kBgr8, 0);
  for (int y = 8; y < 40; ++y) {
    for (int x = 0; x < 64; ++x) green.row(y)[3 * x + 1] = 255;
  }
  folder_.WriteImage("mask.png", green);
  EXPECT_TRUE(Open().ok()) << Open().status().ToString();
}

TEST_F(ImageFolderSourceTest, DuplicateTimeStampIsRefusedWithItsLine) {
  folder_.Write("times.txt", "0\n0.04\n0.04\n0.12\n0.16\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("times.txt:3: time stamp 0.040000000 s repeats"));
}

TEST_F(ImageFolderSourceTest, BackwardTimeStampIsRefusedWithItsLine) {
  folder_.Write("times.txt", "0\n0.04\n0.08\n0.07\n0.16\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("times.txt:4: time stamp 0.070000000 s is earlier"));
}

TEST_F(ImageFolderSourceTest, TimeThatIsNoNumberIsRefusedWithItsLine) {
  folder_.Write("times.txt", "# seconds\n0\n0.04\nnan\n0.12\n0.16\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("times.txt:4: 'nan' is not finite"));
  folder_.Write("times.txt", "0 000000.png\n0.04 000001.png\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("each line holds one time in seconds"));
}

TEST_F(ImageFolderSourceTest, CountsThatDifferAreRefused) {
  folder_.Write("times.txt", "0\n0.04\n0.08\n0.12\n");
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("times.txt: 4 time stamps for 5 images in"));
}

TEST_F(ImageFolderSourceTest, WithoutTimesTheCalibrationsRateCounts) {
  std::filesystem::remove(folder_.Path("times.txt"));
  Result<std::unique_ptr<FrameSource>> source = Open({.first_frame = 2});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->Next(kNoDeadline).value().timestamp.time_since_epoch().count(), 80'000'000);
}

TEST_F(ImageFolderSourceTest, WithoutTimesAndRateTheSequenceIsRefused) {
  std::filesystem::remove(folder_.Path("times.txt"));
  folder_.Write("calib.yaml", Replaced(kSmallCalibration, "Camera.fps: 25\n", ""));
  EXPECT_THAT(OpenError(StatusCode::kNotFound),
              AllOf(HasSubstr("times.txt: no such file"), HasSubstr("states no frame rate")));
}

// As a run asks that would guess the calibration.
TEST_F(ImageFolderSourceTest, WithoutTimesAndCalibrationBothAreNamed) {
  std::filesystem::remove(folder_.Path("times.txt"));
  std::filesystem::remove(folder_.Path("calib.yaml"));
  const std::string error = OpenError(StatusCode::kNotFound, {.calibration = CameraCalibration{}});
  EXPECT_THAT(error, AllOf(HasSubstr("times.txt: no such file"), HasSubstr("no calibration"),
                           HasSubstr("--frame-rate HZ"), Not(HasSubstr("states no frame rate"))));
}

TEST_F(ImageFolderSourceTest, EmptySequenceIsRefused) {
  std::filesystem::remove_all(folder_.Path("frames"));
  std::filesystem::create_directory(folder_.Path("frames"));
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument), HasSubstr("frames: the sequence is empty"));
}

TEST_F(ImageFolderSourceTest, PartBeyondTheEndIsRefused) {
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, {.first_frame = 5}), HasSubstr("it has 5 frames"));
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, {.first_frame = 3, .last_frame = 2}),
              HasSubstr("the last frame, 2, lies before the first, 3"));
  EXPECT_THAT(OpenError(StatusCode::kInvalidArgument, {.every_nth = 0}), HasSubstr("every_nth is 0"));
}

TEST_F(ImageFolderSourceTest, MissingFolderAndCalibrationAreNamed) {
  EXPECT_THAT(OpenImageFolder(folder_.Path("no"), {}).status().message(), HasSubstr("no: no such folder"));
  std::filesystem::remove(folder_.Path("calib.yaml"));
  EXPECT_THAT(OpenError(StatusCode::kNotFound), HasSubstr("no camera calibration"));
  EXPECT_THAT(OpenError(StatusCode::kNotFound, {.calibration_path = folder_.Path("other.yaml")}),
              HasSubstr("other.yaml: no such file"));
}

TEST_F(ImageFolderSourceTest, OptionsReplaceCalibrationAndMask) {
  folder_.Write("other/camera.yaml", Replaced(kSmallCalibration, "40.5", "41.5"));
  folder_.WriteImage("other/window.png", FlatImage(64, 48, PixelFormat::kGrey8, 255));
  Result<std::unique_ptr<FrameSource>> source =
      Open({.calibration_path = folder_.Path("other/camera.yaml"), .mask_path = folder_.Path("other/window.png")});
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  EXPECT_EQ((*source)->calibration().fx, 41.5);
  EXPECT_EQ((*source)->static_mask().width, 64);
}

TEST_F(ImageFolderSourceTest, BuffersAreReused) {
  Result<std::unique_ptr<FrameSource>> source = Open();
  ASSERT_TRUE(source.ok()) << source.status().ToString();
  const std::uint8_t* first = (*source)->Next(kNoDeadline).value().image.data;
  EXPECT_EQ((*source)->Next(kNoDeadline).value().image.data, first);
}

}  // namespace
}  // namespace haustra
