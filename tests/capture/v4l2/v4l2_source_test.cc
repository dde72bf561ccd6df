#include "capture/v4l2/v4l2_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <functional>
#include <set>

#include "capture/calibration_reader.h"
#include "capture/codec/jpeg_codec.h"
#include "tests/capture/temp_folder.h"
#include "tests/capture/v4l2/scripted_camera.h"

namespace haustra::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

V4l2Options Options() {
  V4l2Options options;
  options.device = "/dev/video0";
  return options;
}

Result<std::unique_ptr<V4l2Source>> Open(ScriptedCamera& camera, const V4l2Options& options = Options(),
                                         const SequenceOptions& sequence = {}) {
  return V4l2Source::Create(options, sequence, camera);
}

std::unique_ptr<V4l2Source> MustOpen(ScriptedCamera& camera, const V4l2Options& options = Options(),
                                     const SequenceOptions& sequence = {}) {
  Result<std::unique_ptr<V4l2Source>> source = Open(camera, options, sequence);
  EXPECT_TRUE(source.ok()) << source.status().ToString();
  return source.ok() ? std::move(*source) : nullptr;
}

// Indices of the next frames; -1 for each answer that is none.
std::vector<int> Indices(V4l2Source& source, int num_calls) {
  std::vector<int> indices;
  for (int i = 0; i < num_calls; ++i) {
    const Result<Frame> frame = source.Next(kNoDeadline);
    indices.push_back(frame.ok() ? static_cast<int>(frame->index) : -1);
  }
  return indices;
}

std::uint8_t LumaAt(const ImageView& image, int x, int y) {
  if (image.format == PixelFormat::kYuyv) return image.row(y)[2 * x];
  if (image.format == PixelFormat::kUyvy) return image.row(y)[2 * x + 1];
  return image.row(y)[x];
}

// What it sees and when.

TEST(V4l2Source, CameraTakesNoPictureBeforeTheFirstIsAskedFor) {
  RecordProperty("req", "DATA-002");
  ScriptedCamera camera;
  // A driver that stamps when a picture is fetched: its time does not tell whose picture it is.
  camera.faults[0].is_unstamped = true;
  const auto source = MustOpen(camera);
  camera.Sleep(seconds(3600));
  const TimePoint begin = camera.now;
  const Result<Frame> frame = source->Next(kNoDeadline);
  ASSERT_TRUE(frame.ok()) << frame.status().ToString();
  EXPECT_GT(camera.now, begin) << "it was not there before";
  EXPECT_EQ(LumaAt(frame->image, 0, 0), ScriptedCamera::Luma(0, 0, 0));
}

TEST(V4l2Source, NoPictureStaysInItsBuffers) {
  RecordProperty("req", "DATA-001");
  for (const BufferMemory memory : {BufferMemory::kMapped, BufferMemory::kDmaBuf}) {
    ScriptedCamera camera;
    V4l2Options options = Options();
    options.memory = memory;
    auto source = MustOpen(camera, options);
    EXPECT_EQ(Indices(*source, 6), std::vector<int>({0, 1, 2, 3, 4, 5}));
    source.reset();
    EXPECT_EQ(camera.num_maps, 0);
    EXPECT_EQ(camera.num_left, 0);
    // Nor in those of a camera that was pulled out.
    source = MustOpen(camera, options);
    EXPECT_EQ(Indices(*source, 2), std::vector<int>({0, 1}));
    camera.is_present = false;
    EXPECT_EQ(Indices(*source, 1), std::vector<int>({-1}));
    EXPECT_EQ(camera.num_maps, 0);
    EXPECT_EQ(camera.num_left, 0);
  }
}

TEST(V4l2Source, FormatOfItsFramesIsKnownBeforeTheFirst) {
  for (const std::uint32_t fourcc : {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG}) {
    for (const bool halve : {false, true}) {
      for (const ChannelChoice channels : {ChannelChoice::kAsStored, ChannelChoice::kGrey}) {
        for (const bool is_part : {false, true}) {
          ScriptedCamera camera;
          camera.modes = {{fourcc, 64, 48, {25}}};
          const Image colour(64, 48, PixelFormat::kBgr8);
          ASSERT_TRUE(capture::internal::EncodeJpeg(colour.view(), 95, &camera.jpeg).ok());
          V4l2Options options = Options();
          if (is_part) options.region = {8, 8, 32, 24};
          SequenceOptions sequence;
          sequence.halve = halve;
          sequence.channels = channels;
          const auto source = MustOpen(camera, options, sequence);
          const std::optional<PixelFormat> format = source->pixel_format();
          const Result<Frame> frame = source->Next(kNoDeadline);
          ASSERT_TRUE(frame.ok()) << frame.status().ToString();
          EXPECT_EQ(format, frame->image.format) << FourccText(fourcc) << halve << is_part;
        }
      }
    }
  }
}

// What is agreed with the camera.

TEST(V4l2Source, WhatOnlyARecordingCanDoIsRefused) {
  ScriptedCamera camera;
  SequenceOptions sequence;
  sequence.reversed = true;
  EXPECT_THAT(Open(camera, Options(), sequence).status().message(), HasSubstr("cannot be played backwards"));
  sequence = {};
  sequence.last_frame = 10;
  EXPECT_THAT(Open(camera, Options(), sequence).status().message(), HasSubstr("no first and no last frame"));
  EXPECT_TRUE(MustOpen(camera)->is_live());
}

TEST(V4l2Source, TakesTheFormatThatCostsLeast) {
  ScriptedCamera camera;
  camera.modes = {
      {V4L2_PIX_FMT_MJPEG, 64, 48, {60}}, {V4L2_PIX_FMT_YUYV, 64, 48, {25}}, {V4L2_PIX_FMT_NV12, 64, 48, {25}}};
  EXPECT_THAT(MustOpen(camera)->Describe(), HasSubstr("Tower Camera (/dev/video0), NV12 64x48 at 25 Hz"));
}

TEST(V4l2Source, TakesAFormatThatIsFastEnough) {
  ScriptedCamera camera;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 64, 48, {5}}, {V4L2_PIX_FMT_UYVY, 64, 48, {60, 50, 25}}};
  V4l2Options options = Options();
  options.rate_hz = 50;
  EXPECT_THAT(MustOpen(camera, options)->Describe(), HasSubstr("UYVY 64x48 at 50 Hz"));
}

TEST(V4l2Source, TakesTheSizeOfTheCalibrationAndItsRateIfThereIsOne) {
  TempFolder folder;
  CameraCalibration calibration{CameraModelKind::kKannalaBrandt, 96, 64, 60, 60, 48, 32};
  calibration.rate_hz = 50;
  ASSERT_TRUE(WriteCalibration(folder.Path("c.yaml"), calibration).ok());
  ScriptedCamera camera;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 64, 48, {25}}, {V4L2_PIX_FMT_YUYV, 96, 64, {30, 25}}};
  SequenceOptions sequence;
  sequence.calibration_path = folder.Path("c.yaml");
  const auto source = MustOpen(camera, Options(), sequence);
  EXPECT_THAT(source->Describe(), HasSubstr("YUYV 96x64 at 30 Hz"));
  EXPECT_EQ(source->calibration().fx, 60);
  EXPECT_EQ(source->calibration().rate_hz, 25);
}

TEST(V4l2Source, ARateThatCannotBeSetIsAnErrorOnlyWhenItWasAskedFor) {
  ScriptedCamera camera;
  camera.modes.front().rates_hz = {12.5, 25};
  camera.rate_error = -EINVAL;
  EXPECT_THAT(MustOpen(camera)->Describe(), HasSubstr("YUYV 64x48 at 12.5 Hz"));

  V4l2Options options = Options();
  options.rate_hz = 25;
  const auto asked = Open(camera, options);
  EXPECT_EQ(asked.code(), StatusCode::kUnavailable);
  EXPECT_THAT(asked.status().message(), HasSubstr("VIDIOC_S_PARM"));

  camera.rate_error = -ENODEV;
  EXPECT_THAT(Open(camera).status().message(), HasSubstr("VIDIOC_S_PARM"));
  EXPECT_EQ(camera.num_opened, 0);
}

TEST(V4l2Source, WhatTheCameraDoesNotOfferIsRefusedWithWhatItOffers) {
  ScriptedCamera camera;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 64, 48, {25}}, {V4L2_PIX_FMT_MJPEG, 96, 64, {60, 30}}};
  V4l2Options options = Options();
  options.width_px = 1440;
  options.height_px = 1080;
  const auto source = Open(camera, options);
  EXPECT_EQ(source.code(), StatusCode::kUnavailable);
  EXPECT_THAT(source.status().message(),
              HasSubstr("does not offer 1440x1080; it offers YUYV 64x48 (25 Hz), MJPG 96x64 (60, 30 Hz)"));

  options = Options();
  options.rate_hz = 50;
  EXPECT_THAT(Open(camera, options).status().message(), HasSubstr("at 50 Hz"));
  options.rate_hz = 0;
  options.format = V4L2_PIX_FMT_NV12;
  EXPECT_THAT(Open(camera, options).status().message(), HasSubstr("NV12 64x48"));
  EXPECT_EQ(camera.num_opened, 0);
}

TEST(V4l2Source, DriversThatDoNotListSizesOrRatesAreTakenAtTheirWord) {
  ScriptedCamera camera;
  camera.has_sizes = camera.says_rate = false;
  V4l2Options options = Options();
  options.width_px = 64;
  options.height_px = 48;
  const auto source = MustOpen(camera, options);
  EXPECT_EQ(Indices(*source, 3), (std::vector<int>{0, 1, 2}));
}

TEST(V4l2Source, WhatCannotBeReadIsRefusedByName) {
  ScriptedCamera camera;
  camera.capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  EXPECT_THAT(Open(camera).status().message(), HasSubstr("several planes"));
  camera.capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  EXPECT_THAT(Open(camera).status().message(), HasSubstr("does not capture pictures"));
  camera.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_READWRITE;
  EXPECT_THAT(Open(camera).status().message(), HasSubstr("no mapped buffers"));
}

TEST(V4l2Source, ACameraIsFoundByAPartOfItsName) {
  ScriptedCamera camera;
  V4l2Options options;
  options.device = "tower";
  EXPECT_NE(MustOpen(camera, options), nullptr);
  options.device = "microscope";
  const auto source = Open(camera, options);
  EXPECT_EQ(source.code(), StatusCode::kUnavailable);
  EXPECT_THAT(source.status().message(), HasSubstr("'microscope'"));
  EXPECT_THAT(source.status().message(), HasSubstr("/dev/video0 'Tower Camera'"));
}

// One of them may be unplugged again.
TEST(V4l2Source, CamerasThatANameDoesNotTellApartAreNotAvailable) {
  ScriptedCamera camera;
  camera.has_twin = true;
  V4l2Options options;
  options.device = "tower";
  const auto source = Open(camera, options);
  EXPECT_EQ(source.code(), StatusCode::kUnavailable);
  EXPECT_THAT(source.status().message(), HasSubstr("several cameras have 'tower' in their names"));
}

TEST(V4l2Source, InputsAreChosenByNameOrNumber) {
  ScriptedCamera camera;
  camera.inputs = {"HDMI", "SDI 1"};
  V4l2Options options = Options();
  options.input = "SDI 1";
  MustOpen(camera, options);
  EXPECT_EQ(camera.set_input, 1);
  options.input = "0";
  MustOpen(camera, options);
  EXPECT_EQ(camera.set_input, 0);
  options.input = "DVI";
  EXPECT_THAT(Open(camera, options).status().message(), HasSubstr("no input 'DVI'; there are 0 'HDMI', 1 'SDI 1'"));
}

TEST(V4l2Source, AReceiverFollowsItsSignalAndSaysWhenThereIsNone) {
  ScriptedCamera camera;
  camera.inputs = {"HDMI"};
  camera.has_timings = true;
  camera.says_rate = false;
  camera.timings_error = -ENOLINK;
  EXPECT_EQ(Open(camera).code(), StatusCode::kUnavailable);
  EXPECT_THAT(Open(camera).status().message(), HasSubstr("no signal on input 'HDMI'"));
  camera.timings_error = 0;
  EXPECT_THAT(MustOpen(camera)->Describe(), HasSubstr("at 50 Hz"));
}

TEST(V4l2Source, ANameThatFillsItsFieldEndsThere) {
  ScriptedCamera camera;
  const std::string name(sizeof(v4l2_input::name), 'x');
  camera.inputs = {name};
  camera.has_timings = true;
  camera.timings_error = -ENOLINK;
  EXPECT_THAT(Open(camera).status().message(), HasSubstr("no signal on input '" + name + "' ("));
}

// Interlaced pictures.

TEST(V4l2Source, InterlacedPicturesAreRefusedWithAWayOut) {
  for (const std::uint32_t field : {V4L2_FIELD_INTERLACED, V4L2_FIELD_SEQ_TB, V4L2_FIELD_ALTERNATE, V4L2_FIELD_TOP}) {
    ScriptedCamera camera;
    camera.field = field;
    const auto source = Open(camera);
    EXPECT_EQ(source.code(), StatusCode::kUnavailable) << field;
    EXPECT_THAT(source.status().message(), HasSubstr("field=top or field=bottom"));
  }
  ScriptedCamera camera;
  V4l2Options options = Options();
  options.field = FieldChoice::kTop;
  EXPECT_THAT(Open(camera, options).status().message(), HasSubstr("go together with halving"));
  SequenceOptions sequence;
  sequence.halve = true;
  EXPECT_THAT(Open(camera, options, sequence).status().message(), HasSubstr("progressive"));
}

TEST(V4l2Source, OfAnInterlacedPictureTheChosenRowsAreUsed) {
  SequenceOptions sequence;
  sequence.halve = true;
  for (const std::uint32_t fourcc : {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_NV12}) {
    for (const std::uint32_t field : {V4L2_FIELD_INTERLACED, V4L2_FIELD_SEQ_TB, V4L2_FIELD_SEQ_BT}) {
      for (const FieldChoice choice : {FieldChoice::kTop, FieldChoice::kBottom}) {
        ScriptedCamera camera;
        camera.modes.front().fourcc = fourcc;
        camera.field = field;
        camera.extra_pitch_bytes = 16;
        V4l2Options options = Options();
        options.field = choice;
        const auto source = MustOpen(camera, options, sequence);
        const Result<Frame> frame = source->Next(kNoDeadline);
        ASSERT_TRUE(frame.ok());
        EXPECT_TRUE(frame->shows_one_field);
        ASSERT_EQ(frame->image.width, 32);
        ASSERT_EQ(frame->image.height, 24);
        const int row = choice == FieldChoice::kTop ? 0 : 1;
        for (int y = 0; y < 24; ++y) {
          const int expected = (camera.Luma(0, 20, 2 * y + row) + camera.Luma(0, 21, 2 * y + row) + 1) / 2;
          ASSERT_EQ(frame->image.row(y)[10], expected) << "row " << y << " field " << field;
        }
      }
    }
  }
}

TEST(V4l2Source, FieldsThatAGrabberWeavesAndCallsProgressiveAreTakenApart) {
  for (const std::uint32_t fourcc : {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_NV12}) {
    for (const bool halve : {false, true}) {
      ScriptedCamera camera;
      camera.modes.front().fourcc = fourcc;
      camera.extra_pitch_bytes = 16;
      camera.is_woven = true;
      SequenceOptions sequence;
      sequence.halve = halve;
      const auto source = MustOpen(camera, Options(), sequence);
      const std::optional<PixelFormat> format = source->pixel_format();
      for (std::uint32_t i = 0; i < 4; ++i) {
        const Result<Frame> frame = source->Next(kNoDeadline);
        ASSERT_TRUE(frame.ok());
        EXPECT_TRUE(frame->shows_one_field);
        EXPECT_EQ(frame->image.format, format);
        const int top = camera.Luma(i, 20, 4), next = camera.Luma(i, 20, 6), between = (top + next + 1) / 2;
        if (!halve) {
          EXPECT_EQ(LumaAt(frame->image, 20, 4), top);
          EXPECT_EQ(LumaAt(frame->image, 20, 5), between);
        } else {
          const int top_b = camera.Luma(i, 21, 4), between_b = (top_b + camera.Luma(i, 21, 6) + 1) / 2;
          EXPECT_EQ(frame->image.row(2)[10], (top + top_b + between + between_b + 2) / 4);
        }
      }
      // Another signal may come with another stream.
      camera.is_woven = false;
      camera.is_present = false;
      EXPECT_FALSE(source->Next(kNoDeadline).ok());
      camera.is_present = true;
      Result<Frame> frame = source->Next(kNoDeadline);
      for (int i = 0; i < 20 && !frame.ok(); ++i) frame = source->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok());
      EXPECT_FALSE(frame->shows_one_field);
    }
  }
}

TEST(V4l2Source, WithoutDeinterlacingAPictureStaysWhereTheCameraWroteIt) {
  ScriptedCamera camera;
  camera.is_woven = true;
  SequenceOptions sequence;
  sequence.deinterlace = DeinterlaceChoice::kOff;
  const auto source = MustOpen(camera, Options(), sequence);
  const Result<Frame> frame = source->Next(kNoDeadline);
  ASSERT_TRUE(frame.ok());
  EXPECT_FALSE(frame->shows_one_field);
  EXPECT_EQ(LumaAt(frame->image, 10, 5), camera.Luma(0, 10 + ScriptedCamera::kWovenShift, 5));
  ASSERT_TRUE(source->Next(kNoDeadline).ok());
}

// A camera of 50 fields of 24 rows a second, of which the lower ones are asked for.
struct FieldByField {
  FieldByField() {
    camera.field = V4L2_FIELD_ALTERNATE;
    camera.modes.front().height_px = 24;
    camera.modes.front().rates_hz = {50};
    options.field = FieldChoice::kBottom;
    sequence.halve = true;
  }
  ScriptedCamera camera;
  V4l2Options options = Options();
  SequenceOptions sequence;
};

TEST(V4l2Source, OfFieldsThatComeOneByOneTheOthersAreLeftOut) {
  FieldByField given;
  const auto source = MustOpen(given.camera, given.options, given.sequence);
  const Result<Frame> frame = source->Next(kNoDeadline);
  ASSERT_TRUE(frame.ok()) << frame.status().ToString();
  EXPECT_EQ(frame->image.height, 24);
  EXPECT_EQ(source->calibration().height_px, 24);
  EXPECT_EQ(source->counters().num_left_out, 1u);
}

// By now its size is known, and a driver that is asked for the whole picture answers with a field.
TEST(V4l2Source, ACameraOfFieldsThatComeOneByOneComesBack) {
  FieldByField given;
  for (const int height_px : {0, 48}) {
    given.options.width_px = height_px > 0 ? 64 : 0;
    given.options.height_px = height_px;
    const auto source = MustOpen(given.camera, given.options, given.sequence);
    ASSERT_NE(source, nullptr);
    ASSERT_TRUE(source->Next(kNoDeadline).ok());
    given.camera.is_present = false;
    EXPECT_FALSE(source->Next(kNoDeadline).ok());
    given.camera.is_present = true;
    const Result<Frame> frame = source->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->image.height, 24);
  }
}

// Pixels.

TEST(V4l2Source, PicturesAreGivenOutWhereTheCameraWroteThem) {
  const std::pair<std::uint32_t, PixelFormat> kFormats[] = {{V4L2_PIX_FMT_YUYV, PixelFormat::kYuyv},
                                                            {V4L2_PIX_FMT_UYVY, PixelFormat::kUyvy},
                                                            {V4L2_PIX_FMT_GREY, PixelFormat::kGrey8},
                                                            {V4L2_PIX_FMT_NV12, PixelFormat::kNv12}};
  for (const auto& [fourcc, format] : kFormats) {
    ScriptedCamera camera;
    camera.modes.front().fourcc = fourcc;
    camera.extra_pitch_bytes = 8;
    const auto source = MustOpen(camera);
    for (std::uint32_t i = 0; i < 6; ++i) {
      const Result<Frame> frame = source->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok());
      ASSERT_EQ(frame->image.format, format);
      EXPECT_EQ(LumaAt(frame->image, 63, 47), camera.Luma(i, 63, 47));
    }
  }
}

TEST(V4l2Source, RegionsAreCutOutAndTheCalibrationFollows) {
  TempFolder folder;
  ASSERT_TRUE(
      WriteCalibration(folder.Path("whole.yaml"), {CameraModelKind::kKannalaBrandt, 64, 48, 60, 60, 30, 20}).ok());
  ASSERT_TRUE(
      WriteCalibration(folder.Path("region.yaml"), {CameraModelKind::kKannalaBrandt, 40, 30, 60, 60, 18, 17}).ok());
  for (const std::uint32_t fourcc : {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_NV12}) {
    ScriptedCamera camera;
    camera.modes.front().fourcc = fourcc;
    V4l2Options options = Options();
    options.region = {12, 3, 40, 30};
    SequenceOptions sequence;
    for (const char* file : {"whole.yaml", "region.yaml"}) {
      sequence.calibration_path = folder.Path(file);
      const auto source = MustOpen(camera, options, sequence);
      EXPECT_EQ(source->calibration().cx, 18);
      EXPECT_EQ(source->calibration().cy, 17);
      EXPECT_EQ(source->calibration().width_px, 40);
      const Result<Frame> frame = source->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok());
      EXPECT_EQ(frame->image.width, 40);
      EXPECT_EQ(frame->image.height, 30);
      EXPECT_EQ(LumaAt(frame->image, 5, 7), camera.Luma(0, 17, 10));
    }
    sequence.halve = true;
    const auto source = MustOpen(camera, options, sequence);
    EXPECT_EQ(source->calibration().cx, (18 + 0.5) / 2 - 0.5);
    const Result<Frame> frame = source->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok());
    ASSERT_EQ(frame->image.width, 20);
    const int sum = camera.Luma(0, 14, 5) + camera.Luma(0, 15, 5) + camera.Luma(0, 14, 6) + camera.Luma(0, 15, 6);
    EXPECT_EQ(frame->image.row(1)[1], (sum + 2) / 4);
  }
}

TEST(V4l2Source, RegionsThatDoNotFitAreRefused) {
  ScriptedCamera camera;
  V4l2Options options = Options();
  options.region = {30, 0, 40, 30};
  EXPECT_THAT(Open(camera, options).status().message(),
              HasSubstr("40x30+30+0 does not lie inside the picture of 64x48"));
  options.region = {1, 0, 40, 30};
  EXPECT_THAT(Open(camera, options).status().message(), HasSubstr("must be even"));
}

TEST(V4l2Source, ACalibrationOfAnotherSizeIsRefused) {
  TempFolder folder;
  ASSERT_TRUE(WriteCalibration(folder.Path("c.yaml"), {CameraModelKind::kKannalaBrandt, 40, 30, 60, 60, 20, 15}).ok());
  ScriptedCamera camera;
  V4l2Options options = Options();
  options.width_px = 64;
  options.height_px = 48;
  SequenceOptions sequence;
  sequence.calibration_path = folder.Path("c.yaml");
  EXPECT_THAT(Open(camera, options, sequence).status().message(),
              HasSubstr("c.yaml: the calibration is for 40x30, the camera's pictures are 64x48"));
}

TEST(V4l2Source, MjpegIsDecodedAndGivenOutAsItCame) {
  ScriptedCamera camera;
  camera.modes.front().fourcc = V4L2_PIX_FMT_MJPEG;
  Image grey(64, 48, PixelFormat::kGrey8);
  for (int y = 0; y < 48; ++y) std::fill_n(grey.row(y), 64, static_cast<std::uint8_t>(100 + y));
  ASSERT_TRUE(capture::internal::EncodeJpeg(grey.view(), 95, &camera.jpeg).ok());
  auto source = MustOpen(camera);
  const Result<Frame> frame = source->Next(kNoDeadline);
  ASSERT_TRUE(frame.ok()) << frame.status().ToString();
  EXPECT_NEAR(frame->image.row(20)[30], 120, 2);
  EXPECT_EQ(source->encoded().size(), camera.jpeg.size());
  source.reset();

  camera.jpeg[camera.jpeg.size() / 2] ^= 0xff;
  camera.jpeg.resize(camera.jpeg.size() / 2);
  const auto damaged = MustOpen(camera);
  EXPECT_EQ(damaged->Next(kNoDeadline).code(), StatusCode::kDataLoss);
  EXPECT_EQ(damaged->counters().num_damaged, 1u);
}

TEST(V4l2Source, CameraThatSomebodyElseUsesIsUnavailable) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  const Status status = Open(camera).status();
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_THAT(status.message(), HasSubstr("another program uses the camera"));
}

// Time and numbers.

TEST(V4l2Source, TimeStampsAreTheKernels) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  const TimePoint begin = camera.now;
  for (int i = 1; i <= 5; ++i) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok());
    EXPECT_EQ(frame->timestamp, begin + i * milliseconds(40));
    camera.Sleep(milliseconds(7));  // the reader is slow, the stamps are not
  }
}

TEST(V4l2Source, WithoutAKernelStampTheTimeOfTheDequeueCounts) {
  ScriptedCamera camera;
  for (std::uint32_t i = 0; i < 9; ++i) camera.faults[i].is_unstamped = true;
  const auto source = MustOpen(camera);
  const Result<Frame> frame = source->Next(kNoDeadline);
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(frame->timestamp, camera.now);
  EXPECT_EQ(source->counters().num_unstamped, 1u);
}

TEST(V4l2Source, LostPicturesAreGapsInTheNumbers) {
  ScriptedCamera camera;
  camera.faults[2].is_lost = camera.faults[3].is_lost = true;
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 4), (std::vector<int>{0, 1, 4, 5}));
  EXPECT_EQ(source->counters().num_lost, 2u);
}

TEST(V4l2Source, EveryNthIsTakenOfACameraThatDoesNotSayItsRate) {
  for (const bool says_rate : {true, false}) {
    ScriptedCamera camera;
    camera.says_rate = says_rate;
    SequenceOptions sequence;
    sequence.every_nth = 2;
    const auto source = MustOpen(camera, Options(), sequence);
    EXPECT_EQ(source->calibration().rate_hz, 12.5) << says_rate;
    const TimePoint first = source->Next(kNoDeadline).value().timestamp;
    EXPECT_EQ(source->Next(kNoDeadline).value().timestamp - first, milliseconds(80)) << says_rate;
  }
}

// Each frame that is left out is reported: a million of them would keep the reader busy for a while.
TEST(V4l2Source, ADamagedCountOfACameraThatDoesNotSayItsRateDoesNotRunAway) {
  capture::internal::FrameCounter counter;
  counter.Restart(0.0, 25.0, 1);
  const TimePoint begin(seconds(100));
  EXPECT_EQ(counter.Count(0, begin).index, 0u);
  EXPECT_LE(counter.Count(1u << 30, begin + milliseconds(40)).index, 10u);
  // What was lost while nothing came for a second still counts.
  EXPECT_EQ(counter.Count((1u << 30) + 26, begin + milliseconds(1040)).num_lost, 25u);
}

TEST(V4l2Source, FastCamerasAreThinnedOutTo25Hz) {
  ScriptedCamera camera;
  camera.modes.front().rates_hz = {50};
  const auto source = MustOpen(camera);
  EXPECT_EQ(source->calibration().rate_hz, 25);
  TimePoint before;
  for (std::uint32_t i = 0; i < 20; ++i) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok());
    EXPECT_EQ(frame->index, i);
    if (i > 0) {
      EXPECT_EQ(frame->timestamp - before, milliseconds(40));
    }
    before = frame->timestamp;
  }
  EXPECT_EQ(source->counters().num_left_out, 19u);
}

TEST(V4l2Source, OfOddRatesTheMeanIs25Hz) {
  for (const double rate : {30.0, 60.0, 59.94}) {
    ScriptedCamera camera;
    camera.modes.front().rates_hz = {rate};
    const auto source = MustOpen(camera);
    Result<Frame> first = source->Next(kNoDeadline);
    ASSERT_TRUE(first.ok());
    Result<Frame> frame = first;
    for (int i = 0; i < 250; ++i) frame = source->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok());
    EXPECT_EQ(frame->index, 250u) << rate;
    EXPECT_NEAR(ToSeconds(frame->timestamp - first->timestamp), 10.0, 0.04) << rate;
  }
}

TEST(V4l2Source, OfFastCamerasALostPictureIsReplacedByItsNeighbour) {
  ScriptedCamera camera;
  camera.modes.front().rates_hz = {50};
  camera.faults[4].is_lost = true;                               // of frame 2; picture 5 takes its place
  camera.faults[8].has_error_flag = true;                        // of frame 4; likewise
  camera.faults[12].is_lost = camera.faults[13].is_lost = true;  // all of frame 6
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 8), (std::vector<int>{0, 1, 2, 3, 4, 5, 7, 8}));
}

TEST(V4l2Source, AReaderThatWasAwayGetsTheNewestPicture) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 1), (std::vector<int>{0}));
  camera.Sleep(milliseconds(120));
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{3, 4}));
  EXPECT_EQ(source->counters().num_stale, 2u);

  ScriptedCamera other;
  V4l2Options options = Options();
  options.skip_stale = false;
  const auto recorder = MustOpen(other, options);
  EXPECT_EQ(Indices(*recorder, 1), (std::vector<int>{0}));
  other.Sleep(milliseconds(120));
  EXPECT_EQ(Indices(*recorder, 4), (std::vector<int>{1, 2, 3, 4}));
}

// What goes wrong.

TEST(V4l2Source, DamagedPicturesAreReportedAndPassedOver) {
  ScriptedCamera camera;
  camera.faults[1].has_error_flag = true;
  camera.faults[3].is_short = true;
  camera.faults[5].stamp_shift = -milliseconds(100);
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 7), (std::vector<int>{0, -1, 2, -1, 4, -1, 6}));
  EXPECT_EQ(source->counters().num_damaged, 3u);
  EXPECT_EQ(source->counters().num_lost, 0u);
  camera.faults[7].stamp_shift = -milliseconds(100);
  EXPECT_THAT(source->Next(kNoDeadline).status().message(),
              HasSubstr("picture 7 has the time stamp 1000.220 s, which is not later than 1000.280 s, the one before"));
}

TEST(V4l2Source, AStampAheadOfTheClockCostsOnePictureAtMost) {
  ScriptedCamera camera;
  camera.faults[5].stamp_shift = std::chrono::hours(1);
  const auto source = MustOpen(camera);
  TimePoint before;
  int num_frames = 0;
  for (int i = 0; i < 10; ++i) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (!frame.ok()) continue;
    ++num_frames;
    EXPECT_GT(frame->timestamp, before);
    EXPECT_LE(frame->timestamp, camera.now);
    // What it said is not kept from whoever logs.
    EXPECT_EQ(frame->refused_stamp.has_value(), frame->index == 5) << frame->index;
    EXPECT_GT(frame->refused_stamp.value_or(kNoDeadline), camera.now + std::chrono::minutes(59));
    before = frame->timestamp;
  }
  EXPECT_GE(num_frames, 9);
  EXPECT_EQ(source->counters().num_unstamped, 1u);
}

// A driver that has lost the time of its device. The stream goes on, and so must the frames.
TEST(V4l2Source, StampsThatGoBackForGoodCostAFewPictures) {
  ScriptedCamera camera;
  for (std::uint32_t i = 60; i < 110; ++i) camera.faults[i].stamp_shift = -seconds(2);
  const auto source = MustOpen(camera);
  TimePoint before;
  int num_missed = 0, num_refused = 0;
  for (int i = 0; i < 120; ++i) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    num_missed += !frame.ok();
    if (!frame.ok()) continue;
    EXPECT_GT(frame->timestamp, before) << frame->index;
    EXPECT_LE(frame->timestamp, camera.now);
    EXPECT_EQ(frame->refused_stamp.has_value(), frame->index >= 60 && frame->index < 110) << frame->index;
    num_refused += frame->refused_stamp.has_value();
    before = frame->timestamp;
  }
  EXPECT_LE(num_missed, 5);
  EXPECT_GE(num_refused, 45);
  EXPECT_EQ(source->counters().num_lost, 0u);
}

TEST(V4l2Source, StampsOfAnotherClockAfterAReplugStopNothing) {
  for (const Duration shift : {-Duration(seconds(500)), Duration(std::chrono::hours(1))}) {
    ScriptedCamera camera;
    camera.faults[2].stamp_shift = std::chrono::hours(1);
    const auto source = MustOpen(camera);
    for (int i = 0; i < 4; ++i) (void)source->Next(kNoDeadline);
    camera.is_present = false;
    EXPECT_FALSE(source->Next(kNoDeadline).ok());
    camera.is_present = true;
    for (std::uint32_t i = 0; i < 9; ++i) camera.faults[i].stamp_shift = shift;
    TimePoint before = camera.now;
    for (int i = 0; i < 9; ++i) {
      const Result<Frame> frame = source->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok()) << frame.status().ToString();
      EXPECT_GT(frame->timestamp, before);
      EXPECT_LE(frame->timestamp, camera.now);
      before = frame->timestamp;
    }
  }
}

TEST(V4l2Source, NextNeverWaitsLongerThanItSays) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  camera.is_silent = true;
  TimePoint begin = camera.now;
  EXPECT_EQ(source->Next(begin + milliseconds(100)).code(), StatusCode::kDeadlineExceeded);
  EXPECT_EQ(camera.now, begin + milliseconds(100));
  begin = camera.now;
  EXPECT_EQ(source->Next(kNoDeadline).code(), StatusCode::kDeadlineExceeded);
  EXPECT_EQ(camera.now, begin + seconds(1));
  EXPECT_EQ(source->counters().num_timeouts, 2u);

  camera.is_present = false;
  begin = camera.now;
  for (int i = 0; i < 20; ++i) EXPECT_EQ(source->Next(camera.now + milliseconds(10)).code(), StatusCode::kUnavailable);
  EXPECT_LE(camera.now - begin, milliseconds(200));
}

TEST(V4l2Source, ASignalThatComesBackGoesOn) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{0, 1}));
  camera.is_silent = true;
  EXPECT_EQ(source->Next(kNoDeadline).code(), StatusCode::kDeadlineExceeded);
  camera.is_silent = false;
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{2, 3}));
  EXPECT_EQ(camera.num_streams, 1);
}

TEST(V4l2Source, AfterLongSilenceTheStreamIsBegunAgain) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 1), (std::vector<int>{0}));
  camera.is_silent = true;
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(source->Next(kNoDeadline).ok());
  camera.is_silent = false;
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{1, 2}));
  EXPECT_EQ(camera.num_streams, 2);
  EXPECT_EQ(source->counters().num_restarts, 1u);
}

TEST(V4l2Source, ACameraThatIsPulledOutAndPutBackGoesOn) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{0, 1}));
  camera.is_present = false;
  const Result<Frame> gone = source->Next(kNoDeadline);
  EXPECT_EQ(gone.code(), StatusCode::kUnavailable);
  EXPECT_THAT(gone.status().message(), HasSubstr("/dev/video0"));
  EXPECT_EQ(camera.num_opened, 0) << "an open descriptor keeps the name of the node from being used again";
  for (int i = 0; i < 5; ++i) EXPECT_EQ(source->Next(kNoDeadline).code(), StatusCode::kUnavailable);
  const TimePoint back = camera.now;
  camera.is_present = true;
  Result<Frame> frame = source->Next(kNoDeadline);
  ASSERT_TRUE(frame.ok()) << frame.status().ToString();
  EXPECT_EQ(frame->index, 2u);
  EXPECT_LE(camera.now - back, milliseconds(300));
  EXPECT_EQ(source->counters().num_restarts, 1u);
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{3, 4}));
}

TEST(V4l2Source, FatalErrorsOfTheStreamAreSurvived) {
  for (const int error : {-EIO, -ENODEV, -EINVAL, -EPIPE}) {
    ScriptedCamera camera;
    camera.faults[2].dequeue_error = error;
    const auto source = MustOpen(camera);
    EXPECT_EQ(Indices(*source, 5), (std::vector<int>{0, 1, -1, 2, 3})) << error;
    EXPECT_EQ(source->counters().num_restarts, 1u);
  }
}

TEST(V4l2Source, WhenTheSignalChangesTheStreamIsBegunAgain) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 1), (std::vector<int>{0}));
  camera.has_source_change = true;
  EXPECT_EQ(Indices(*source, 3), (std::vector<int>{-1, 1, 2}));
  EXPECT_EQ(camera.num_streams, 2);
}

// The event bears the number of the input.
TEST(V4l2Source, WhenTheSignalOfAChosenInputChangesTheStreamIsBegunAgain) {
  ScriptedCamera camera;
  camera.inputs = {"Composite", "HDMI"};
  V4l2Options options = Options();
  options.input = "HDMI";
  const auto source = MustOpen(camera, options);
  EXPECT_EQ(Indices(*source, 1), (std::vector<int>{0}));
  camera.has_source_change = true;
  EXPECT_EQ(Indices(*source, 3), (std::vector<int>{-1, 1, 2}));
  EXPECT_EQ(camera.num_streams, 2);
}

TEST(V4l2Source, ACameraThatComesBackDifferentStaysAway) {
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  EXPECT_EQ(Indices(*source, 1), (std::vector<int>{0}));
  camera.is_present = false;
  EXPECT_FALSE(source->Next(kNoDeadline).ok());
  camera.is_present = true;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 96, 64, {25}}};
  const Result<Frame> other = source->Next(kNoDeadline);
  EXPECT_EQ(other.code(), StatusCode::kUnavailable);
  EXPECT_THAT(other.status().message(), HasSubstr("does not offer 64x48"));
  camera.modes = {{V4L2_PIX_FMT_GREY, 64, 48, {25}}};
  EXPECT_TRUE(source->Next(kNoDeadline).ok());
}

TEST(V4l2Source, ACameraMayComeLater) {
  ScriptedCamera camera;
  camera.is_present = false;
  EXPECT_EQ(Open(camera).code(), StatusCode::kUnavailable);
  V4l2Options options = Options();
  options.may_come_later = true;
  EXPECT_THAT(Open(camera, options).status().message(), HasSubstr("give size=WxH"));
  options.width_px = 64;
  options.height_px = 48;
  const auto source = MustOpen(camera, options);
  EXPECT_EQ(source->calibration().width_px, 64);
  EXPECT_EQ(source->Next(kNoDeadline).code(), StatusCode::kUnavailable);
  camera.is_present = true;
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{0, 1}));
}

// Its format is known only then.
TEST(V4l2Source, ACameraThatComesLaterMustFitItsRegion) {
  ScriptedCamera camera;
  camera.is_present = false;
  V4l2Options options = Options();
  options.may_come_later = true;
  options.width_px = 64;
  options.height_px = 48;
  options.region = {1, 0, 63, 48};
  const auto source = MustOpen(camera, options);
  camera.is_present = true;
  for (int i = 0; i < 3; ++i) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    EXPECT_EQ(frame.code(), StatusCode::kUnavailable);
    EXPECT_THAT(frame.status().message(), HasSubstr("/dev/video0: region 63x48+1+0: in YUYV two columns share"));
    EXPECT_FALSE(camera.is_open());
    EXPECT_EQ(source->pixel_format(), std::nullopt);
  }
  EXPECT_EQ(source->counters().num_restarts, 0u);
  // Another is plugged in.
  camera.modes.front().fourcc = V4L2_PIX_FMT_GREY;
  camera.Sleep(seconds(1));
  const Result<Frame> frame = source->Next(kNoDeadline);
  ASSERT_TRUE(frame.ok()) << frame.status().ToString();
  EXPECT_EQ(frame->image.width, 63);
  // And another one of the first kind.
  camera.is_present = false;
  EXPECT_EQ(source->Next(kNoDeadline).code(), StatusCode::kUnavailable);
  camera.is_present = true;
  camera.modes.front().fourcc = V4L2_PIX_FMT_UYVY;
  camera.Sleep(seconds(1));
  EXPECT_THAT(source->Next(kNoDeadline).status().message(), HasSubstr("in UYVY two columns share"));
}

// Seconds for each call, as of a USB device that answers nothing.
TEST(V4l2Source, WhileADeviceIsBroughtBackEachOfItsCallsIsASignOfLife) {
  RecordProperty("req", "DMN-002");
  ScriptedCamera camera;
  const auto source = MustOpen(camera);
  int num_slow = 0;
  camera.on_call = [&](unsigned long request) {
    const bool is_of_pictures = request == VIDIOC_DQBUF || (request == VIDIOC_QBUF && camera.is_streaming());
    if (is_of_pictures) return;
    EXPECT_EQ(source->recovering_since(), camera.now) << "call " << num_slow;
    camera.Sleep(seconds(5));
    ++num_slow;
  };
  // What is left of a call's second is nothing.
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{-1, 0}));
  EXPECT_EQ(num_slow, 2) << "to begin";
  EXPECT_EQ(source->recovering_since(), std::nullopt);
  camera.is_silent = true;
  for (int i = 0; i < 6; ++i) (void)source->Next(kNoDeadline);
  EXPECT_GT(num_slow, 10) << "it is closed and opened";
  EXPECT_EQ(source->recovering_since(), std::nullopt);
  camera.is_silent = false;
  EXPECT_EQ(Indices(*source, 3), (std::vector<int>{1, 2, 3}));
  camera.on_call = nullptr;
}

// The tower shows something else for now; the regions and calibrations of the configuration are right.
TEST(V4l2Source, ACameraWithoutItsModeIsOneThatMayComeLater) {
  ScriptedCamera camera;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 96, 64, {25}}};
  V4l2Options options = Options();
  options.width_px = 64;
  options.height_px = 48;
  EXPECT_EQ(Open(camera, options).code(), StatusCode::kUnavailable);
  options.may_come_later = true;
  const auto source = MustOpen(camera, options);
  ASSERT_NE(source, nullptr);
  const Result<Frame> other = source->Next(kNoDeadline);
  EXPECT_EQ(other.code(), StatusCode::kUnavailable);
  EXPECT_THAT(other.status().message(),
              HasSubstr("/dev/video0: Tower Camera does not offer 64x48; it offers YUYV 96x64 (25 Hz)"));
  camera.modes = {CameraMode{}};
  EXPECT_EQ(Indices(*source, 2), (std::vector<int>{0, 1}));
}

TEST(V4l2Source, WhatDoesNotFitTheSizeThatTheCameraHasNowMayFitTheNext) {
  TempFolder folder;
  const CameraCalibration calibration{CameraModelKind::kKannalaBrandt, 64, 48, 60, 60, 32, 24};
  ASSERT_TRUE(WriteCalibration(folder.Path("c.yaml"), calibration).ok());
  ScriptedCamera camera;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 96, 64, {25}}};
  V4l2Options options = Options();
  options.region = {8, 8, 40, 32};
  SequenceOptions sequence;
  sequence.calibration_path = folder.Path("c.yaml");
  const Status status = Open(camera, options, sequence).status();
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_THAT(status.message(), HasSubstr("the calibration is for 64x48, the camera's pictures are 96x64"));
  camera.modes = {CameraMode{}};
  EXPECT_NE(MustOpen(camera, options, sequence), nullptr);
  // With a size of its own the camera has no part in it.
  options.width_px = 96;
  options.height_px = 64;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 96, 64, {25}}};
  EXPECT_EQ(Open(camera, options, sequence).code(), StatusCode::kInvalidArgument);
}

// DMA-BUF.

V4l2Options WithDmaBuf() {
  V4l2Options options = Options();
  options.memory = BufferMemory::kDmaBuf;
  return options;
}

TEST(V4l2Source, PicturesInTheMemoryOfTheSystemAreGivenOutWhereTheCameraWroteThem) {
  ScriptedCamera camera;
  {
    const auto source = MustOpen(camera, WithDmaBuf());
    EXPECT_THAT(source->Describe(), HasSubstr("YUYV 64x48 at 25 Hz, imported buffers"));
    for (std::uint32_t i = 0; i < 10; ++i) {
      const Result<Frame> frame = source->Next(kNoDeadline);
      ASSERT_TRUE(frame.ok()) << frame.status().ToString();
      EXPECT_EQ(frame->index, i);
      EXPECT_EQ(LumaAt(frame->image, 17, 31), ScriptedCamera::Luma(i, 17, 31));
      EXPECT_EQ(camera.num_synced, static_cast<int>(i));  // the newest is still read
      EXPECT_GE(source->ExportBuffer().value(), 0);
    }
    EXPECT_EQ(camera.num_maps, 4);
    EXPECT_EQ(camera.num_opened, 5);
  }
  EXPECT_EQ(camera.num_maps, 0);
  EXPECT_EQ(camera.num_opened, 0);
}

TEST(V4l2Source, WithoutDmaBufBuffersAreMappedAndTheReasonIsSaid) {
  const auto describe = [](const std::function<void(ScriptedCamera&)>& change) {
    ScriptedCamera camera;
    change(camera);
    const auto source = MustOpen(camera, WithDmaBuf());
    EXPECT_EQ(Indices(*source, 6), (std::vector<int>{0, 1, 2, 3, 4, 5}));
    EXPECT_EQ(camera.num_opened, 1);
    return source->Describe();
  };
  EXPECT_THAT(describe([](ScriptedCamera& camera) { camera.has_heap = false; }),
              HasSubstr("mapped buffers (no DMA-BUF: /dev/dma_heap/system: No such file or directory)"));
  EXPECT_THAT(describe([](ScriptedCamera& camera) { camera.can_import = false; }),
              HasSubstr("mapped buffers (no DMA-BUF: /dev/video0: VIDIOC_REQBUFS: Invalid argument)"));
  EXPECT_THAT(describe([](ScriptedCamera& camera) { camera.can_attach = false; }),
              HasSubstr("mapped buffers (no DMA-BUF: /dev/video0: VIDIOC_QBUF: Invalid argument)"));
}

TEST(V4l2Source, MappedBuffersAreExportedOnceEach) {
  ScriptedCamera camera;
  {
    const auto source = MustOpen(camera);
    EXPECT_EQ(source->ExportBuffer().code(), StatusCode::kUnavailable);
    std::set<int> descriptors;
    for (int i = 0; i < 12; ++i) {
      ASSERT_TRUE(source->Next(kNoDeadline).ok());
      descriptors.insert(source->ExportBuffer().value());
    }
    EXPECT_EQ(descriptors.size(), 4u);
    EXPECT_EQ(camera.num_opened, 5);
  }
  EXPECT_EQ(camera.num_opened, 0);

  camera.can_export = false;
  const auto source = MustOpen(camera);
  ASSERT_TRUE(source->Next(kNoDeadline).ok());
  EXPECT_THAT(source->ExportBuffer().status().message(), HasSubstr("/dev/video0: VIDIOC_EXPBUF"));
  EXPECT_TRUE(source->Next(kNoDeadline).ok());
}

// Every call that the source makes fails once, in every way that a driver may fail.
class V4l2SourceCalls : public testing::TestWithParam<BufferMemory> {};
INSTANTIATE_TEST_SUITE_P(Memory, V4l2SourceCalls, testing::Values(BufferMemory::kMapped, BufferMemory::kDmaBuf));

TEST_P(V4l2SourceCalls, WhicheverFailsNothingLeaksAndFramesComeBack) {
  V4l2Options options = Options();
  options.memory = GetParam();
  int num_calls = 0;
  {
    ScriptedCamera camera;
    const auto source = MustOpen(camera, options);
    Indices(*source, 4);
    num_calls = camera.num_calls;
  }
  ASSERT_GT(num_calls, 30);
  for (const int error : {-EIO, -ENODEV, -EBUSY, -EINVAL, -ENOTTY, -EACCES}) {
    for (int call = 0; call < num_calls; ++call) {
      ScriptedCamera camera;
      camera.failing_call = call;
      camera.failure = error;
      {
        Result<std::unique_ptr<V4l2Source>> source = Open(camera, options);
        if (source.ok()) {
          int num_frames = 0;
          for (int i = 0; i < 12; ++i) num_frames += (*source)->Next(kNoDeadline).ok();
          EXPECT_GE(num_frames, 9) << "call " << call << " error " << error;
        } else {
          EXPECT_FALSE(source.status().message().empty());
        }
      }
      ASSERT_EQ(camera.num_opened, 0) << "call " << call;
      ASSERT_EQ(camera.num_maps, 0) << "call " << call;
      ASSERT_FALSE(camera.is_streaming());
    }
  }
}

}  // namespace
}  // namespace haustra::test
