// A recording as a user has one: a file without a calibration, whose length nobody knows before it has been read.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "capture/codec/image_codec.h"
#include "tests/capture/video_writer.h"
#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"
#include "tools/exit_codes.h"

namespace haustra::end_to_end {
namespace {

class Video : public testing::Test {
 protected:
  static constexpr int kNumFrames = 50;

  void SetUp() override {
    const std::string scratch = ScratchFolder();
    video_ = scratch + "/clip.mkv";
    out_ = scratch + "/out";
    std::vector<Image> frames;
    for (int i = 0; i < kNumFrames; ++i) {
      Result<Image> frame = ReadImage(FramePath(SequenceFolder("standard"), i), ChannelChoice::kGrey);
      ASSERT_TRUE(frame.ok()) << frame.status().message();
      frames.push_back(std::move(*frame));
    }
    ASSERT_EQ(WriteVideo(video_, "ffv1", 25, frames), "");
  }
  CommandResult Run(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"run", video_, "--out", out_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return HaustraOnCpu(arguments);
  }

  std::string video_, out_;
};

TEST_F(Video, OneCommandEndsWithMapsAndAReport) {
  const CommandResult run = Run();
  ASSERT_EQ(run.exit_code, kExitOk) << run.ToString();
  EXPECT_NE(run.out.find(out_ + "/report.html"), std::string::npos) << run.out;
  EXPECT_TRUE(Exists(out_ + "/report.html"));
  EXPECT_TRUE(Exists(out_ + "/calib.yaml"));
  EXPECT_EQ(ReadCsv(out_ + "/frames.csv").size(), static_cast<std::size_t>(kNumFrames));
  const std::string images = ReadBytes(out_ + "/maps/map_0000/images.txt");
  EXPECT_NE(images.find(" frame_0000"), std::string::npos) << images.substr(0, 1000);
}

TEST_F(Video, PartThatIsEmptyIsRefusedAndNothingIsLost) {
  const CommandResult fresh = Run({"--first-frame", "70"});
  EXPECT_EQ(fresh.exit_code, kExitBadData) << fresh.ToString();
  EXPECT_NE(fresh.err.find("empty from frame 70 on"), std::string::npos) << fresh.err;
  EXPECT_FALSE(std::filesystem::exists(out_));
  ASSERT_EQ(Run({"--last-frame", "9", "--report", "off"}).exit_code, kExitOk);
  const std::string before = ReadBytes(out_ + "/frames.csv");
  EXPECT_EQ(Run({"--first-frame", "70", "--overwrite"}).exit_code, kExitBadData);
  EXPECT_EQ(ReadBytes(out_ + "/frames.csv"), before);
}

// A folder of pictures from elsewhere states neither times nor a camera. What is made of the run later needs neither
// once more.
TEST(FolderOfPictures, IsRunAtTheFrameRateThatIsNamed) {
  const std::string scratch = ScratchFolder(), pictures = scratch + "/pictures", out = scratch + "/out";
  std::filesystem::create_directories(pictures);
  for (int i = 0; i < 30; ++i) {
    std::filesystem::copy_file(FramePath(SequenceFolder("standard"), i),
                               pictures + "/" + std::to_string(i + 85) + ".jpg");
  }
  std::vector<std::string> arguments = {
      "run",           pictures, "--out",       out, "--calibration", scratch + "/camera.yaml",
      "--first-frame", "5",      "--every-nth", "2"};
  std::string camera = ReadBytes(SequenceFolder("standard") + "/calib.yaml");
  const std::size_t rate = camera.find("Camera.fps:");
  ASSERT_NE(rate, std::string::npos) << camera;
  WriteBytes(scratch + "/camera.yaml", camera.erase(rate, camera.find('\n', rate) + 1 - rate));
  const CommandResult without = HaustraOnCpu(arguments);
  EXPECT_EQ(without.exit_code, kExitNoInput) << without.ToString();
  EXPECT_NE(without.err.find("give --frame-rate"), std::string::npos) << without.err;
  arguments.insert(arguments.end(), {"--frame-rate", "12.5"});
  const CommandResult run = HaustraOnCpu(arguments);
  ASSERT_EQ(run.exit_code, kExitOk) << run.ToString();
  const CsvRows frames = ReadCsv(out + "/frames.csv");
  ASSERT_EQ(frames.size(), 13u);
  EXPECT_EQ(frames[0].at("timestamp_ns"), "400000000");
  EXPECT_EQ(frames[12].at("timestamp_ns"), "2320000000");
  const CommandResult report = Haustra({"report", out, "--sequence", pictures, "--html", scratch + "/page.html"});
  EXPECT_EQ(report.exit_code, kExitOk) << report.ToString();
  const CommandResult surface = Haustra({"surface", out, "--sequence", pictures, "--out", scratch + "/surface"});
  EXPECT_EQ(surface.err.find("frame rate"), std::string::npos) << surface.ToString();
  EXPECT_EQ(surface.err.find("not the sequence"), std::string::npos) << surface.ToString();
}

}  // namespace
}  // namespace haustra::end_to_end
