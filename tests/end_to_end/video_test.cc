// A recording as a user has one: a file without a calibration, whose length nobody knows before it has been read.
#include <gtest/gtest.h>

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
  EXPECT_EQ(FilesBelow(out_), std::vector<std::string>());
  ASSERT_EQ(Run({"--last-frame", "9", "--report", "off"}).exit_code, kExitOk);
  const std::string before = ReadBytes(out_ + "/frames.csv");
  EXPECT_EQ(Run({"--first-frame", "70", "--overwrite"}).exit_code, kExitBadData);
  EXPECT_EQ(ReadBytes(out_ + "/frames.csv"), before);
}

}  // namespace
}  // namespace haustra::end_to_end
