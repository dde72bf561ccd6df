// The folder that comes out: complete, readable by our own readers, the same for the same seed.
#include "tools/render/render_sequence.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "capture/calibration_reader.h"
#include "capture/codec/image_codec.h"
#include "capture/ground_truth.h"
#include "capture/open_sequence.h"
#include "tests/capture/temp_folder.h"

namespace haustra::render {
namespace {

namespace fs = std::filesystem;

class RenderSequenceTest : public testing::Test {
 protected:
  static RenderOptions Small(double seconds) {
    RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
    // A short colon: less to paint.
    options.preset.path.start_arc_mm = 14.0;
    options.preset.blind_end_mm = 30.0;
    options.seconds = seconds;
    options.width_px = 240;
    options.height_px = 180;
    options.num_threads = 2;
    return options;
  }
  std::string Folder(const std::string& name) const { return root_.Path(name); }
  // Every file of a folder by its relative path.
  static std::map<std::string, std::string> Content(const std::string& folder) {
    std::map<std::string, std::string> content;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (!entry.is_regular_file()) continue;
      std::ifstream file(entry.path(), std::ios::binary);
      std::stringstream text;
      text << file.rdbuf();
      content[fs::relative(entry.path(), folder).string()] = text.str();
    }
    return content;
  }

  TempFolder root_;
};

TEST_F(RenderSequenceTest, SameSeedGivesSameBytesOnAnyNumberOfThreads) {
  RenderOptions options = Small(0.6);
  options.events = {{EventKind::kBubbles, 0.2, 0.2}};
  options.num_threads = 1;
  ASSERT_TRUE(RenderSequence(Folder("a"), options, nullptr).ok());
  options.num_threads = 3;
  ASSERT_TRUE(RenderSequence(Folder("b"), options, nullptr).ok());
  options.seed = 2;
  ASSERT_TRUE(RenderSequence(Folder("c"), options, nullptr).ok());
  const auto a = Content(Folder("a")), b = Content(Folder("b")), c = Content(Folder("c"));
  EXPECT_EQ(a.size(), 15u + 6u);
  EXPECT_EQ(a, b);
  EXPECT_NE(a.at("frames/000007.jpg"), c.at("frames/000007.jpg"));
  EXPECT_NE(a.at("groundtruth.txt"), c.at("groundtruth.txt"));
}

TEST_F(RenderSequenceTest, SlipChangesNothingBeforeItAndIsTheSameOnAnyNumberOfThreads) {
  RenderOptions options = Small(0.6);
  options.events = {{EventKind::kBubbles, 0.1, 0.1}};
  ASSERT_TRUE(RenderSequence(Folder("calm"), options, nullptr).ok());
  options.events.insert(options.events.begin(), {EventKind::kSlip, 0.3, 0.2});
  options.num_threads = 1;
  ASSERT_TRUE(RenderSequence(Folder("a"), options, nullptr).ok());
  options.num_threads = 3;
  ASSERT_TRUE(RenderSequence(Folder("b"), options, nullptr).ok());
  const auto calm = Content(Folder("calm")), a = Content(Folder("a")), b = Content(Folder("b"));
  EXPECT_EQ(a, b);
  for (const char* frame : {"frames/000000.jpg", "frames/000003.jpg", "frames/000007.jpg"}) {
    EXPECT_EQ(a.at(frame), calm.at(frame)) << frame;
  }
  EXPECT_NE(a.at("frames/000011.jpg"), calm.at("frames/000011.jpg"));
  EXPECT_EQ(a.at("events.csv"), "first_frame,last_frame,kind,visible\n3,5,bubbles,0\n8,12,slip,0\n");
}

TEST_F(RenderSequenceTest, StrengthsOfZeroChangeNoByte) {
  RenderOptions options = Small(0.4);
  options.preset = *FindPreset("breathing");
  options.preset.path.start_arc_mm = 14.0;
  ASSERT_TRUE(RenderSequence(Folder("a"), options, nullptr).ok());
  options.shutter = Shutter{0.0, 0.0, 0.0};
  options.calibration_error = *ParseCalibrationError("0,0,0,0");
  options.preset.colon.breathing.tangential = 0.0;
  // What a strength of zero does not turn on may be anything.
  options.preset.colon.breathing.pressure = {0.0, 5.0};
  options.preset.lens_drops = {0, 30.0, 5.0, 6.0, 2.0};
  options.preset.mucosa.stool = 0.0;
  options.preset.mucosa.blood = {0.0, 1.0};
  options.preset.colon.fluid = 0.0;
  ASSERT_TRUE(RenderSequence(Folder("b"), options, nullptr).ok());
  EXPECT_EQ(Content(Folder("a")), Content(Folder("b")));
}

TEST_F(RenderSequenceTest, EveryStrengthGivesTheSameBytesOnAnyNumberOfThreads) {
  RenderOptions options = Small(0.3);
  options.shutter = {0.5, 0.6, 0.5};
  options.events = {{EventKind::kInstrument, 0.0, 0.3}, {EventKind::kNarrowBand, 0.1, 0.1}};
  options.preset.colon.breathing.amplitude = 0.1;
  options.preset.colon.breathing.wave_amplitude = 0.1;
  options.preset.colon.breathing.tangential = 0.1;
  options.preset.colon.breathing.pressure = {0.3, 2.0};
  options.preset.lens_drops.count = 6;
  options.preset.mucosa.stool = 0.2;
  options.preset.mucosa.blood = {0.2, 0.2};
  options.preset.colon.fluid = 0.5;
  options.with_depth = true;
  options.with_normals = true;
  options.with_seen_wall = true;
  options.num_threads = 1;
  ASSERT_TRUE(RenderSequence(Folder("a"), options, nullptr).ok());
  options.num_threads = 3;
  ASSERT_TRUE(RenderSequence(Folder("b"), options, nullptr).ok());
  EXPECT_EQ(Content(Folder("a")), Content(Folder("b")));
  ASSERT_TRUE(RenderSequence(Folder("c"), Small(0.3), nullptr).ok());
  EXPECT_NE(Content(Folder("a")).at("frames/000003.jpg"), Content(Folder("c")).at("frames/000003.jpg"));
  // The truth is about the camera alone.
  EXPECT_EQ(Content(Folder("a")).at("groundtruth.txt"), Content(Folder("c")).at("groundtruth.txt"));
}

TEST_F(RenderSequenceTest, LiquidIsOfTheColonAndOutOfRangeIsNamed) {
  RenderOptions options = Small(0.2);
  options.preset.colon.fluid = 0.61;
  EXPECT_EQ(options.Validate().message(), "fluid is 0.61, must be in [0, 0.6] of the radius");
  options.preset.colon.fluid = -0.1;
  EXPECT_FALSE(options.Validate().ok());
  options.preset.colon.fluid = 0.5;
  options.with_normals = true;
  ASSERT_TRUE(RenderSequence(Folder("wet"), options, nullptr).ok());
  ASSERT_TRUE(RenderSequence(Folder("dry"), Small(0.2), nullptr).ok());
  auto wet = Content(Folder("wet")), dry = Content(Folder("dry"));
  EXPECT_EQ(wet.size(), dry.size() + 5u);
  EXPECT_NE(wet.at("frames/000002.jpg"), dry.at("frames/000002.jpg"));
  const auto normals = ReadImage(Folder("wet") + "/normals/000002.png", ChannelChoice::kAsStored);
  ASSERT_TRUE(normals.ok()) << normals.status().message();
  EXPECT_EQ(normals->width(), 60);
  EXPECT_EQ(normals->height(), 45);
  // The rest of the truth is about the camera alone.
  for (const char* file : {"groundtruth.txt", "calib.yaml", "events.csv", "revisits.csv", "times.txt", "mask.png"}) {
    EXPECT_EQ(wet.at(file), dry.at(file)) << file;
  }
  // Its pictures are those of a sequence: another one may take its place.
  options = Small(0.2);
  options.overwrite = true;
  ASSERT_TRUE(RenderSequence(Folder("wet"), options, nullptr).ok());
  EXPECT_EQ(Content(Folder("wet")), dry);
}

TEST_F(RenderSequenceTest, WrongCalibrationLeavesPicturesAndTheTruthAsTheyAre) {
  RenderOptions options = Small(0.2);
  ASSERT_TRUE(RenderSequence(Folder("right"), options, nullptr).ok());
  options.calibration_error = {2.0, 3.0, -1.0, 0.01};
  ASSERT_TRUE(RenderSequence(Folder("wrong"), options, nullptr).ok());
  auto right = Content(Folder("right")), wrong = Content(Folder("wrong"));
  EXPECT_EQ(wrong.at("calib_true.yaml"), right.at("calib.yaml"));
  EXPECT_NE(wrong.at("calib.yaml"), right.at("calib.yaml"));
  EXPECT_EQ(right.count("calib_true.yaml"), 0u);
  const auto written = ReadCalibration(Folder("wrong") + "/calib.yaml");
  ASSERT_TRUE(written.ok()) << written.status().message();
  EXPECT_NEAR(written->fx, 1.02 * CalibrationFor(240, 180, 25.0).fx, 1e-6);
  wrong.erase("calib_true.yaml");
  wrong["calib.yaml"] = right["calib.yaml"];
  EXPECT_EQ(wrong, right);
  // The file is one of those that a sequence is made of.
  options.calibration_error = {};
  options.overwrite = true;
  ASSERT_TRUE(RenderSequence(Folder("wrong"), options, nullptr).ok());
  EXPECT_EQ(Content(Folder("wrong")), right);
}

TEST_F(RenderSequenceTest, FieldsAreTheRowsOfTwoMoments) {
  RenderOptions options = Small(0.8);
  options.events = {{EventKind::kJump, 0.28, 0.44}};
  ASSERT_TRUE(RenderSequence(Folder("whole"), options, nullptr).ok());
  options.shutter.field_lag = 0.5;
  ASSERT_TRUE(RenderSequence(Folder("fields"), options, nullptr).ok());
  const auto whole = ReadImage(Folder("whole") + "/frames/000012.jpg", ChannelChoice::kGrey);
  const auto fields = ReadImage(Folder("fields") + "/frames/000012.jpg", ChannelChoice::kGrey);
  ASSERT_TRUE(whole.ok() && fields.ok());
  double change[2] = {0.0, 0.0};  // of even and odd rows
  for (int y = 60; y < 120; ++y) {
    for (int x = 60; x < 180; ++x) change[y % 2] += std::abs(whole->row(y)[x] - fields->row(y)[x]);
  }
  EXPECT_GT(change[1], 2.5 * change[0]);  // JPEG carries some of it over
}

TEST_F(RenderSequenceTest, WidePicturesSurviveEveryEvent) {
  for (const EventKind kind : {EventKind::kRedout, EventKind::kWater, EventKind::kBubbles, EventKind::kDebris,
                               EventKind::kBlur, EventKind::kSlip, EventKind::kNarrowBand, EventKind::kInstrument}) {
    RenderOptions options = Small(0.6);
    options.width_px = 256;
    options.height_px = 144;
    options.events = {{kind, 0.05, 0.5}};
    options.overwrite = true;
    ASSERT_TRUE(RenderSequence(Folder("wide"), options, nullptr).ok());
    // Tissue on the lens shines up to the corners of the window.
    const Result<Image> image = ReadImage(Folder("wide") + "/frames/000007.jpg", ChannelChoice::kGrey);
    ASSERT_TRUE(image.ok()) << image.status().ToString();
    if (kind == EventKind::kRedout) {
      EXPECT_GT(int{image->row(72)[250]}, 20);
    }
  }
}

TEST_F(RenderSequenceTest, FolderIsReadByTheSequenceReader) {
  const RenderOptions options = Small(0.4);
  int num_calls = 0;
  ASSERT_TRUE(RenderSequence(Folder("out"), options, [&](int done, int total) {
                EXPECT_EQ(done, ++num_calls);
                EXPECT_EQ(total, 10);
              }).ok());
  EXPECT_EQ(num_calls, 10);

  const auto source = OpenSequence(Folder("out"), SequenceOptions{});
  ASSERT_TRUE(source.ok()) << source.status().message();
  EXPECT_EQ((*source)->num_frames(), 10u);
  EXPECT_EQ((*source)->calibration().width_px, 240);
  EXPECT_EQ((*source)->calibration().kind, CameraModelKind::kKannalaBrandt);
  EXPECT_FALSE((*source)->static_mask().is_empty());
  const auto poses = ReadGroundTruth(Folder("out") + "/groundtruth.txt");
  ASSERT_TRUE(poses.ok()) << poses.status().message();
  ASSERT_EQ(poses->size(), 10u);
  for (std::size_t i = 0; i < 10; ++i) {
    const auto frame = (*source)->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok()) << frame.status().message();
    EXPECT_NEAR(ToSeconds(frame->timestamp.time_since_epoch()), 0.04 * static_cast<double>(i), 1e-6);
    EXPECT_NEAR(static_cast<double>((*poses)[i].timestamp_ns) * 1e-9, 0.04 * static_cast<double>(i), 1e-6);
  }
}

TEST_F(RenderSequenceTest, PicturesAreWellExposedInsideTheWindowAndBlackOutside) {
  ASSERT_TRUE(RenderSequence(Folder("out"), Small(0.2), nullptr).ok());
  const auto picture = ReadImage(Folder("out") + "/frames/000003.jpg", ChannelChoice::kAsStored);
  const auto mask = ReadImage(Folder("out") + "/mask.png", ChannelChoice::kGrey);
  ASSERT_TRUE(picture.ok() && mask.ok());
  ASSERT_EQ(picture->format(), PixelFormat::kBgr8);
  double red = 0.0, green = 0.0, blue = 0.0;
  int num_inside = 0, num_burnt = 0;
  for (int y = 0; y < 180; ++y) {
    for (int x = 0; x < 240; ++x) {
      const std::uint8_t* bgr = picture->row(y) + 3 * x;
      if (mask->row(y)[x] == 0) continue;
      blue += bgr[0];
      green += bgr[1];
      red += bgr[2];
      num_burnt += bgr[1] > 250 ? 1 : 0;
      ++num_inside;
    }
  }
  EXPECT_EQ(mask->row(90)[120], 255);
  EXPECT_LT(picture->row(4)[3 * 4 + 1], 8);
  red /= num_inside;
  green /= num_inside;
  blue /= num_inside;
  EXPECT_GT(red, 110.0);
  EXPECT_LT(red, 220.0);
  EXPECT_GT(red, 1.2 * green);  // mucosa is pink
  EXPECT_GT(green, blue);
  EXPECT_LT(num_burnt, num_inside / 8);
}

TEST_F(RenderSequenceTest, EventsAreMarkedAndHideTheScene) {
  RenderOptions options = Small(1.0);
  options.events = {{EventKind::kRedout, 0.4, 0.32}};
  ASSERT_TRUE(RenderSequence(Folder("out"), options, nullptr).ok());
  EXPECT_EQ(Content(Folder("out")).at("events.csv"), "first_frame,last_frame,kind,visible\n10,18,redout,0\n");
  // Edges disappear: mean difference between neighbours, relative to brightness.
  const auto detail = [&](int frame) {
    char name[32];
    std::snprintf(name, sizeof(name), "/frames/%06d.jpg", frame);
    const auto picture = ReadImage(Folder("out") + name, ChannelChoice::kGrey);
    double difference = 0.0, sum = 0.0;
    for (int y = 60; y < 120; ++y) {
      for (int x = 60; x < 180; ++x) {
        difference += std::abs(picture->row(y)[x + 4] - picture->row(y)[x - 4]);
        sum += picture->row(y)[x];
      }
    }
    return difference / sum;
  };
  EXPECT_LT(detail(14), 0.4 * detail(5));
  EXPECT_GT(detail(24), 0.6 * detail(5));
}

TEST_F(RenderSequenceTest, EventsThatShowTheSceneCountAsVisibleAndChangeTheirFramesAlone) {
  RenderOptions options = Small(1.0);
  ASSERT_TRUE(RenderSequence(Folder("without"), options, nullptr).ok());
  options.events = {{EventKind::kNarrowBand, 0.6, 0.2}, {EventKind::kInstrument, 0.56, 0.4}};
  ASSERT_TRUE(RenderSequence(Folder("with"), options, nullptr).ok());
  auto without = Content(Folder("without")), with = Content(Folder("with"));
  EXPECT_EQ(with.at("events.csv"), "first_frame,last_frame,kind,visible\n14,24,instrument,1\n15,20,narrowband,1\n");
  EXPECT_EQ(with.at("groundtruth.txt"), without.at("groundtruth.txt"));
  EXPECT_EQ(with.at("revisits.csv"), without.at("revisits.csv"));
  EXPECT_EQ(with.at("frames/000014.jpg"), without.at("frames/000014.jpg"));
  EXPECT_NE(with.at("frames/000015.jpg"), without.at("frames/000015.jpg"));
}

TEST_F(RenderSequenceTest, ExistingFramesAreKeptUnlessOverwriteIsAsked) {
  RenderOptions options = Small(0.4);
  ASSERT_TRUE(RenderSequence(Folder("out"), options, nullptr).ok());
  const auto before = Content(Folder("out"));
  options.seconds = 0.2;
  const Status refused = RenderSequence(Folder("out"), options, nullptr);
  EXPECT_EQ(refused.code(), StatusCode::kFailedPrecondition);
  EXPECT_NE(refused.message().find("overwrite"), std::string::npos);
  EXPECT_EQ(Content(Folder("out")), before);
  options.overwrite = true;
  ASSERT_TRUE(RenderSequence(Folder("out"), options, nullptr).ok());
  EXPECT_EQ(Content(Folder("out")).size(), 5u + 6u);
}

TEST_F(RenderSequenceTest, PlaceThatCannotBeWrittenIsNamed) {
  std::ofstream(Folder("file")) << "x";
  const Status status = RenderSequence(Folder("file") + "/out", Small(0.2), nullptr);
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_NE(status.message().find("file"), std::string::npos);
}

TEST(RenderOptions, OutOfRangeIsNamed) {
  const auto with = [](auto change) {
    RenderOptions options = RenderOptions::FromPreset(Presets().front());
    change(options);
    return options.Validate();
  };
  EXPECT_TRUE(with([](RenderOptions&) {}).ok());
  EXPECT_NE(with([](RenderOptions& o) { o.seconds = -1; }).message().find("seconds"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.seconds = NAN; }).message().find("seconds"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.rate_hz = 0; }).message().find("rate"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.width_px = 10; }).message().find("width"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.height_px = 100000; }).message().find("height"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.num_threads = 0; }).message().find("threads"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.jpeg_quality = 4; }).message().find("quality"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.shutter.readout = 2; }).message().find("readout"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.calibration_error.k1 = 1; }).message().find("k1"), std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.preset.colon.breathing.amplitude = 0.16; }).message().find("breathing"),
            std::string::npos);
  EXPECT_NE(
      with([](RenderOptions& o) { o.preset.colon.breathing.wave_amplitude = -0.1; }).message().find("contraction"),
      std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.preset.colon.breathing.tangential = NAN; }).message().find("tangential"),
            std::string::npos);
  EXPECT_NE(with([](RenderOptions& o) { o.jpeg_quality = 101; }).message().find("quality"), std::string::npos);
}

TEST(FindPreset, UnknownNameListsThoseThatExist) {
  const auto preset = FindPreset("nasal");
  ASSERT_FALSE(preset.ok());
  EXPECT_NE(preset.status().message().find("silicone"), std::string::npos);
}

}  // namespace
}  // namespace haustra::render
