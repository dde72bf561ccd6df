// What `haustra surface` says about input that does not fit, and the files that it writes. How good the surface is:
// tests/engine/surface and tests/end_to_end.
#include "tools/surface/surface_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "capture/codec/image_codec.h"
#include "capture/image.h"
#include "engine/depth/depth_file.h"
#include "engine/surface/depth_map.h"
#include "tests/capture/temp_folder.h"
#include "tests/tools/command/call_command.h"
#include "tests/tools/command/file_size_limit.h"
#include "tests/tools/evaluate/run_folder.h"
#include "tests/tools/report/small_report.h"
#include "tools/command/console.h"
#include "tools/evaluate/colmap_reader.h"
#include "tools/exit_codes.h"
#include "tools/run/run_command.h"
#include "tools/run/surface_of_run.h"
#include "tools/surface/keyframe_pictures.h"
#include "tools/surface/run_surface.h"
#include "tools/surface/surface_text.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class SurfaceCommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    run_ = report::SmallRun();
    WriteRunFolder(folder_, "out", run_);
    folder_.Write("out/maps/map_0000/cameras.txt", "1 OPENCV_FISHEYE 64 48 40 40 32 24 0 0 0 0\n");
    folder_.Write("out/maps/map_0000/images.txt",
                  "2 1 0 0 0 0 0 0 1 000006.jpg\n10.5 5.5 7\n3 1 0 0 0 0.1 0 0 1 session_1/000009.jpg\n\n");
    folder_.Write("out/maps/map_0000/points3D.txt", "7 0.25 0.5 1.5 200 100 90 0.5 2 0\n");
    WriteSequence("seq", 64, 48, 0);
  }
  void WriteSequence(const std::string& name, int width, int height, std::int64_t shift_ns) {
    std::filesystem::create_directories(folder_.At(name + "/frames"));
    std::string times;
    Image grey(width, height, PixelFormat::kGrey8);
    for (int y = 0; y < height; ++y) std::memset(grey.row(y), 90, static_cast<std::size_t>(width));
    for (std::size_t i = 0; i < 10; ++i) {
      char file[32], time[32];
      std::snprintf(file, sizeof(file), "/frames/%06zu.jpg", i);
      ASSERT_TRUE(WriteJpeg(folder_.At(name + file), grey.view(), 90).ok());
      std::snprintf(time, sizeof(time), "%.9f\n", static_cast<double>(run_.frames[i].timestamp_ns + shift_ns) * 1e-9);
      times += time;
    }
    folder_.Write(name + "/times.txt", times);
  }
  // A wall across the tube, two keyframes that look at it from places apart, and the depth that the run kept of both.
  void KeepWall() const {
    constexpr double kRange = 2.0, kApart = 0.28;
    constexpr int kStep = 2, kWidth = 32, kHeight = 24;
    const CameraModel camera =
        *CameraModel::Create(evaluate::ReadColmapGeometry(folder_.At("out/maps/map_0000"))->camera);
    std::string points;
    std::string seen[2];
    for (int id = 0; id < 16; ++id) {
      const Eigen::Vector3d point(-0.2 + 0.1 * (id % 4), -0.2 + 0.1 * (id / 4), kRange);
      points += std::to_string(id) + " " + std::to_string(point.x()) + " " + std::to_string(point.y()) +
                " 2 9 9 9 0.5 2 " + std::to_string(id) + " 3 " + std::to_string(id) + "\n";
      for (int k = 0; k < 2; ++k) {
        Eigen::Vector2d pixel;
        ASSERT_TRUE(camera.Project(point - Eigen::Vector3d(k * kApart, 0, 0), &pixel));
        seen[k] +=
            std::to_string(pixel.x() + 0.5) + " " + std::to_string(pixel.y() + 0.5) + " " + std::to_string(id) + " ";
      }
    }
    folder_.Write("out/maps/map_0000/points3D.txt", points);
    folder_.Write("out/maps/map_0000/images.txt",
                  "2 1 0 0 0 0 0 0 1 000006.jpg\n" + seen[0] + "\n3 1 0 0 0 -0.28 0 0 1 000009.jpg\n" + seen[1] + "\n");
    DepthMap depth(kWidth, kHeight);
    depth.Clear(0.1);
    for (int cell = 0; cell < depth.num_cells(); ++cell) {
      Eigen::Vector3d bearing;
      if (!camera.Unproject({CellCentrePx(cell % kWidth, kStep), CellCentrePx(cell / kWidth, kStep)}, &bearing))
        continue;
      if (bearing.z() > 0.3) depth.Set(cell, bearing.z() / kRange, 200);
    }
    const std::vector<std::uint8_t> bgr(std::size_t{3} * kWidth * kHeight, 120);
    StringSink sink;
    DepthFileWriter writer(sink);
    ASSERT_TRUE(writer.Begin({kStep, kWidth, kHeight}, 2).ok());
    ASSERT_TRUE(writer.Add(1, 6, depth, bgr).ok());
    ASSERT_TRUE(writer.Add(2, 9, depth, bgr).ok());
    ASSERT_TRUE(writer.End().ok());
    folder_.Write("out/maps/map_0000/depth.bin", sink.bytes());
  }
  // Without a sequence: of the depth that the run kept.
  int Surface(const std::string& sequence, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"surface", folder_.At("out"), "--out", folder_.At("to")};
    if (!sequence.empty()) arguments.insert(arguments.end(), {"--sequence", folder_.At(sequence)});
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandAnswer answer = CallCommand({AddSurfaceCommand}, arguments);
    out_ = answer.out;
    err_ = answer.err;
    return answer.code;
  }
  bool IsThere(const std::string& name) const { return std::filesystem::exists(folder_.At(name)); }

  evaluate::TextFolder folder_;
  evaluate::RunOutput run_;
  std::string out_, err_;
};

// Before minutes are spent on a surface that it could not judge.
TEST_F(SurfaceCommandTest, TruthThatJudgesNothingIsRefusedBeforeTheSurfaceIsMade) {
  KeepWall();
  folder_.Write("seq/groundtruth.txt", "0 0 0 0 0 0 0 1\n");
  const std::string truth = folder_.At("seq/groundtruth.txt");
  EXPECT_EQ(Surface("", {"--groundtruth", truth}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr(truth + ": neither depth/ nor seen_wall.csv lies beside it"));
  EXPECT_EQ(Surface("", {"--groundtruth", folder_.At("none.txt")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("none.txt: no such file"));
  EXPECT_EQ(Surface("", {"--groundtruth", folder_.At("seq")}), kExitBadData);
  EXPECT_THAT(err_, HasSubstr(folder_.At("seq") + ": is a folder, not a file"));
}

// Its files are there and good: it does not have what was asked for.
TEST_F(SurfaceCommandTest, RunWithoutAMapHasNoSurface) {
  run_.maps.clear();
  for (evaluate::RunFrame& frame : run_.frames) frame.map_id = frame.live_map_id = frame.keyframe_id = -1;
  WriteRunFolder(folder_, "out", run_);
  EXPECT_EQ(Surface("seq"), kExitConfig);
  EXPECT_THAT(err_, HasSubstr("out: the run has no map"));
}

TEST_F(SurfaceCommandTest, OfWhatHasNoDepthThereIsNoneAndItSaysWhatIsMissing) {
  EXPECT_EQ(Surface("seq"), kExitConfig);
  EXPECT_THAT(err_, HasSubstr("out: there is no surface: map 0: none of its 2 keyframes has a depth: 1 without a "
                              "picture, 1 with too few points that another one sees"));
  EXPECT_FALSE(IsThere("to"));
}

TEST_F(SurfaceCommandTest, TheMaskIsThatOfTheRunWhereItHasOne) {
  const auto write = [this](const std::string& name, int width, std::uint8_t value) {
    Image mask(width, 48, PixelFormat::kGrey8);
    for (int y = 0; y < 48; ++y) std::memset(mask.row(y), value, static_cast<std::size_t>(width));
    ASSERT_TRUE(WritePng(folder_.At(name), mask.view()).ok());
  };
  const auto first_pixel = [this] {
    const Result<evaluate::RunOutput> run = evaluate::ReadRunOutput(folder_.At("out"));
    if (!run.ok()) return -1;
    const Result<surface::KeyframePictures> pictures = surface::ReadKeyframePictures(
        *run, {"000006.jpg"}, run->geometry.begin()->second.camera, folder_.At("seq"), DeinterlaceChoice::kAuto);
    return pictures.ok() && !pictures->mask.is_empty() ? pictures->mask.row(0)[0] : -1;
  };
  write("seq/mask.png", 64, 255);
  EXPECT_EQ(first_pixel(), 255);
  write("out/mask.png", 64, 0);
  EXPECT_EQ(first_pixel(), 0);
  write("out/mask.png", 32, 0);
  EXPECT_EQ(Surface("seq"), kExitBadData);
  EXPECT_THAT(err_, HasSubstr("out/mask.png: not of the size of this run's frames"));
}

TEST_F(SurfaceCommandTest, ARunKeepsTheMaskThatItWasGiven) {
  folder_.Write("seq/calib.yaml", std::string(kSmallCalibration));
  Image mask(64, 48, PixelFormat::kGrey8);
  for (int y = 0; y < 48; ++y) std::memset(mask.row(y), y < 24 ? 255 : 0, 64);
  ASSERT_TRUE(WritePng(folder_.At("half.png"), mask.view()).ok());
  const auto run = [this](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"run", folder_.At("seq"), "--out", folder_.At(out), "--device",
                                       "cpu", "--report",        "off"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandAnswer answer = CallCommand({AddRunCommand}, arguments);
    EXPECT_EQ(answer.code, kExitOk) << answer.err;
  };
  run("plain", {});
  EXPECT_FALSE(IsThere("plain/mask.png"));
  run("masked", {"--mask", folder_.At("half.png")});
  const Result<Image> kept = ReadImage(folder_.At("masked/mask.png"), ChannelChoice::kGrey);
  ASSERT_TRUE(kept.ok()) << kept.status().message();
  EXPECT_EQ(kept->row(23)[5], 255);
  EXPECT_EQ(kept->row(24)[5], 0);
}

TEST_F(SurfaceCommandTest, OfDepthsThatAgreeOnNoWallThereIsNone) {
  KeepWall();
  // The same depths, seen as if from another place.
  std::string images = folder_.Read("out/maps/map_0000/images.txt");
  images.replace(images.find("-0.28 0 0"), 9, "-0.28 0 1");
  folder_.Write("out/maps/map_0000/images.txt", images);
  EXPECT_EQ(Surface(""), kExitConfig);
  EXPECT_THAT(err_, HasSubstr("map 0: its 2 keyframes with depth agree on no wall"));
  EXPECT_FALSE(IsThere("to"));
  SurfaceFigures figures;
  EXPECT_TRUE(MakeSurfaceOfRun(folder_.At("out"), {}, &figures).ok()) << "the run is good without one";
  EXPECT_THAT(figures.why_not, HasSubstr("agree on no wall"));
  EXPECT_FALSE(IsThere("out/surface"));
}

TEST_F(SurfaceCommandTest, AWallWithoutALumenIsAMesh) {
  KeepWall();
  ASSERT_EQ(Surface(""), kExitOk) << err_;
  EXPECT_THAT(out_, HasSubstr("map 0: 2 keyframes with depth"));
  EXPECT_TRUE(folder_.Read("to/map_0000.glb").starts_with("glTF"));
  const nlohmann::json json = nlohmann::json::parse(folder_.Read("to/surface.json"));
  EXPECT_GT(json["maps"][0]["triangles"], 100);
  EXPECT_FALSE(json.contains("depth"));
  EXPECT_THAT(out_, HasSubstr("map 0: no lumen found"));
  EXPECT_EQ(json["maps"][0]["lumen"]["found"], false);
  EXPECT_FALSE(IsThere("to/map_0000_wall.png"));
}

TEST_F(SurfaceCommandTest, AnEarlierSurfaceIsKept) {
  KeepWall();
  ASSERT_EQ(Surface(""), kExitOk) << err_;
  folder_.Write("to/map_0000.ply", "mine");
  EXPECT_EQ(Surface(""), kExitInTheWay);
  EXPECT_EQ(folder_.Read("to/map_0000.ply"), "mine");
  EXPECT_EQ(Surface("", {"--overwrite"}), kExitOk) << err_;
  EXPECT_NE(folder_.Read("to/map_0000.ply"), "mine");
}

TEST_F(SurfaceCommandTest, AFullDiskCostsNoEarlierSurface) {
  surface::RunSurface made;
  made.maps.resize(1);
  made.surfaces.resize(1);
  made.coverages.resize(1);
  made.surfaces[0].mesh = {{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, {{9, 9, 9}, {9, 9, 9}, {9, 9, 9}}, {{0, 1, 2}}};
  surface::SurfaceOutput output;
  output.folder = folder_.At("to");
  ASSERT_EQ(WriteRunSurface(output, made, {}).message(), "");
  const std::string ply = folder_.Read("to/map_0000.ply"), json = folder_.Read("to/surface.json");
  ASSERT_GT(folder_.Read("to/map_0000.glb").size(), ply.size());
  made.surfaces[0].mesh.rgb[0] = {1, 2, 3};
  output.overwrite = true;
  Status status;
  {
    const FileSizeLimit full(ply.size());  // room for the first file
    status = WriteRunSurface(output, made, {});
  }
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_EQ(folder_.Read("to/map_0000.ply"), ply);
  EXPECT_EQ(folder_.Read("to/surface.json"), json);
  for (const auto& entry : std::filesystem::directory_iterator(output.folder)) {
    EXPECT_FALSE(entry.is_directory()) << entry.path();
  }
}

TEST_F(SurfaceCommandTest, QuietHidesWhatWasWrittenAndNoFigure) {
  KeepWall();
  console::SetQuiet(true);
  const int code = Surface("");
  console::SetQuiet(false);
  ASSERT_EQ(code, kExitOk) << err_;
  EXPECT_THAT(out_, HasSubstr("map 0: 2 keyframes with depth"));
  EXPECT_THAT(out_, Not(HasSubstr(folder_.At("to"))));
}

TEST_F(SurfaceCommandTest, ADamagedTruthOfTheWallIsNamedWithItsLine) {
  KeepWall();
  folder_.Write("truth/groundtruth.txt", "0.0 0 0 0 0 0 0 1\n0.04 0 0 1 0 0 0 1\n");
  folder_.Write("truth/seen_wall.csv", "row,column,x_mm,y_mm,z_mm,seen\n0,0,1,2,3,maybe\n");
  EXPECT_NE(Surface("", {"--groundtruth", folder_.At("truth/groundtruth.txt")}), kExitOk);
  EXPECT_THAT(err_, HasSubstr("seen_wall.csv:2: seen is 'maybe'"));
  EXPECT_FALSE(IsThere("to"));
}

TEST_F(SurfaceCommandTest, CoverageByOtherLimitsThanThoseOfTheTruthIsNotJudged) {
  KeepWall();
  folder_.Write("truth/groundtruth.txt", "0.0 0 0 0 0 0 0 1\n0.04 0 0 1 0 0 0 1\n");
  folder_.Write("truth/seen_wall.csv", "row,column,x_mm,y_mm,z_mm,seen\n0,0,1,2,3,well\n");
  ASSERT_EQ(Surface("", {"--groundtruth", folder_.At("truth/groundtruth.txt"), "--max-slant", "60"}), kExitOk) << err_;
  EXPECT_THAT(err_, HasSubstr("coverage is not judged: --max-range and --max-slant"));
}

TEST_F(SurfaceCommandTest, AnotherSequenceIsRefused) {
  WriteSequence("late", 64, 48, 500000000);
  EXPECT_NE(Surface("late"), kExitOk);
  EXPECT_THAT(err_, HasSubstr("not the sequence of this run"));
  WriteSequence("wide", 80, 48, 0);
  EXPECT_NE(Surface("wide"), kExitOk);
  EXPECT_THAT(err_, HasSubstr("frames have 80x48, the run had 64x48"));
  EXPECT_NE(Surface("none"), kExitOk);
  EXPECT_FALSE(IsThere("to"));
}

TEST_F(SurfaceCommandTest, TwiceTheSizeIsHalvedAsTheRunDid) {
  WriteSequence("double", 128, 96, 0);
  EXPECT_EQ(Surface("double"), kExitConfig) << "there is no depth in it";
  EXPECT_THAT(err_, HasSubstr("none of its 2 keyframes has a depth: 1 without a picture"));
}

TEST_F(SurfaceCommandTest, ADamagedModelIsNamedWithItsLine) {
  folder_.Write("out/maps/map_0000/images.txt", "2 1 0 0 x 0 0 0 1 000006.jpg\n10.5 5.5 7\n");
  EXPECT_NE(Surface("seq"), kExitOk);
  EXPECT_THAT(err_, HasSubstr("images.txt:1: not an image"));
  folder_.Write("out/maps/map_0000/images.txt", "2 0 0 0 0 0 0 0 1 000006.jpg\n10.5 5.5 7\n");
  EXPECT_NE(Surface("seq"), kExitOk);
  EXPECT_THAT(err_, HasSubstr("images.txt:1: "));
  EXPECT_FALSE(IsThere("to"));
}

TEST_F(SurfaceCommandTest, OptionsOutOfRangeAreRefused) {
  EXPECT_EQ(Surface("seq", {"--voxel", "0.5"}), kExitUsage);
  EXPECT_EQ(Surface("seq", {"--max-blocks", "0"}), kExitUsage);
  EXPECT_EQ(Surface("seq", {"--threads", "-1"}), kExitUsage);
  EXPECT_EQ(Surface("seq", {"--max-range", "7"}), kExitUsage);
  EXPECT_EQ(Surface("seq", {"--max-slant", "90"}), kExitUsage);
  EXPECT_EQ(Surface("seq", {"--segment", "0"}), kExitUsage);
  EXPECT_EQ(Surface("", {"--device", "cpu"}), kExitUsage) << "nothing is searched";
  EXPECT_EQ(Surface("", {"--deinterlace", "off"}), kExitUsage) << "no picture is read";
}

// What `haustra run` makes of the depth that it has kept.
class SurfaceOfRunTest : public SurfaceCommandTest {
 protected:
  Status Make(SurfaceFigures* figures) const { return MakeSurfaceOfRun(folder_.At("out"), options_, figures); }

  surface::SurfaceOptions options_;
};

TEST_F(SurfaceOfRunTest, IsThatOfTheCommandAndSaysHowMuchWasSeen) {
  KeepWall();
  SurfaceFigures figures;
  ASSERT_EQ(Make(&figures).message(), "");
  const CommandAnswer answer =
      CallCommand({AddSurfaceCommand}, {"surface", folder_.At("out"), "--out", folder_.At("to")});
  ASSERT_EQ(answer.code, kExitOk) << answer.err;
  for (const char* name : {"/map_0000.ply", "/map_0000.glb", "/surface.json"}) {
    ASSERT_TRUE(IsThere(std::string("to") + name)) << name;
    EXPECT_EQ(folder_.Read(std::string("out/surface") + name), folder_.Read(std::string("to") + name)) << name;
  }
  const nlohmann::json maps = nlohmann::json::parse(figures.maps_json);
  const nlohmann::json written = nlohmann::json::parse(folder_.Read("to/surface.json"))["maps"];
  EXPECT_EQ(written[0]["keyframes_with_depth"], 2);
  ASSERT_EQ(maps.size(), 1u);
  EXPECT_EQ(maps[0]["map_id"], 0);
  EXPECT_EQ(maps[0]["lumen"], written[0]["lumen"]);
  EXPECT_EQ(maps[0]["refused_blocks"], 0);
  ASSERT_EQ(figures.lines.size(), 1u);
  EXPECT_THAT(answer.out, HasSubstr(figures.lines[0]));
  EXPECT_EQ(figures.why_not, "");
}

TEST(SurfaceText, AFullVolumeIsSaid) {
  surface::MapSurface made;
  EXPECT_EQ(surface::FullText(3, made), "");
  made.num_refused_blocks = 5;
  EXPECT_THAT(surface::FullText(3, made), HasSubstr("map 3: the mesh is cut off"));
}

TEST_F(SurfaceOfRunTest, NothingIsLeftOfOneThatFails) {
  KeepWall();
  const std::string summary = folder_.Read("out/summary.json");
  folder_.Write("out/maps/map_0000/depth.bin", "no depth");
  SurfaceFigures figures;
  EXPECT_FALSE(Make(&figures).ok());
  EXPECT_THAT(figures.why_not, HasSubstr("depth.bin: "));
  EXPECT_FALSE(IsThere("out/surface"));
  // The disk is full: nothing can be written that has more than some bytes.
  KeepWall();
  rlimit usual{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &usual), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit full{64, usual.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  const Status status = Make(&figures);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &usual), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_THAT(figures.why_not, HasSubstr("surface/map_0000.ply: "));
  EXPECT_FALSE(IsThere("out/surface"));
  EXPECT_EQ(folder_.Read("out/summary.json"), summary);
}

TEST_F(SurfaceOfRunTest, NothingIsLeftOfOneThatIsStopped) {
  KeepWall();
  const std::atomic<bool> stop{true};
  options_.stop = &stop;
  SurfaceFigures figures;
  EXPECT_EQ(Make(&figures).code(), StatusCode::kCancelled);
  EXPECT_THAT(figures.why_not, HasSubstr("it was stopped"));
  EXPECT_FALSE(IsThere("out/surface"));
}

TEST_F(SurfaceOfRunTest, AnEarlierOneIsKept) {
  KeepWall();
  folder_.Write("out/surface/map_0000.ply", "mine");
  SurfaceFigures figures;
  EXPECT_EQ(Make(&figures).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(folder_.Read("out/surface/map_0000.ply"), "mine");
}

TEST_F(SurfaceOfRunTest, ARunWithoutAMapHasNoneAndThatIsNoError) {
  folder_.Remove("out/maps");
  SurfaceFigures figures;
  EXPECT_TRUE(Make(&figures).ok());
  EXPECT_EQ(figures.why_not, "the run has no map");
  EXPECT_FALSE(IsThere("out/surface"));
}

}  // namespace
}  // namespace haustra
