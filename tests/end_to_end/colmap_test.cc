// The COLMAP models of a run with the pictures of its sequence, in COLMAP itself, where it is installed. The pictures
// are named as few data sets do: not by six digits, of which only every second one is used.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;

std::string FindProgram(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (fs::is_regular_file(folder + "/" + name)) return folder + "/" + name;
  }
  return {};
}

// Names of the pictures in an images.txt.
std::set<std::string> PictureNames(const std::string& images) {
  std::istringstream text(ReadBytes(images));
  std::set<std::string> names;
  bool is_pose = true;
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with('#')) continue;
    if (is_pose) names.insert(line.substr(line.rfind(' ') + 1));
    is_pose = !is_pose;
  }
  return names;
}

class Colmap : public testing::Test {
 protected:
  static constexpr int kNumFrames = 60;

  void SetUp() override {
    scratch_ = ScratchFolder();
    sequence_ = scratch_ + "/sequence";
    model_ = scratch_ + "/out/maps/map_0000";
    CopySequence(SequenceFolder("standard"), sequence_, kNumFrames);
    for (int i = 0; i < kNumFrames; ++i) {
      fs::rename(FramePath(sequence_, i), sequence_ + "/frames/view-" + std::to_string(i) + ".jpg");
    }
    const CommandResult run = HaustraOnCpu(
        {"run", sequence_, "--out", scratch_ + "/out", "--first-frame", "3", "--every-nth", "2", "--report", "off"});
    ASSERT_EQ(run.exit_code, 0) << run.ToString();
    ASSERT_TRUE(Exists(model_ + "/images.txt")) << "no map";
  }

  std::string scratch_, sequence_, model_;
};

TEST_F(Colmap, PicturesAreNamedAsTheSequenceNamesThem) {
  const std::set<std::string> names = PictureNames(model_ + "/images.txt");
  EXPECT_GE(names.size(), 2u);
  for (const std::string& name : names) {
    EXPECT_TRUE(Exists(sequence_ + "/frames/" + name)) << name;
    EXPECT_EQ(std::stoi(name.substr(5)) % 2, 1) << name << " was not looked at";
  }
}

TEST_F(Colmap, ColmapLoadsTheModelWithItsPictures) {
  const std::string colmap = FindProgram("colmap");
  if (colmap.empty()) GTEST_SKIP() << "colmap is not installed";
  setenv("QT_QPA_PLATFORM", "offscreen", 1);
  const std::size_t num_pictures = PictureNames(model_ + "/images.txt").size();
  const CommandResult analysis = Command({colmap, "model_analyzer", "--path", model_}).Wait(kHangLimit);
  EXPECT_EQ(analysis.exit_code, 0) << analysis.ToString();
  EXPECT_NE((analysis.out + analysis.err).find("Registered images: " + std::to_string(num_pictures)), std::string::npos)
      << analysis.ToString();

  const std::string out = scratch_ + "/undistorted";
  const CommandResult undistorted = Command({colmap, "image_undistorter", "--image_path", sequence_ + "/frames",
                                             "--input_path", model_, "--output_path", out})
                                        .Wait(kHangLimit);
  EXPECT_EQ(undistorted.exit_code, 0) << undistorted.ToString();
  // Of every picture that it finds it writes one.
  EXPECT_EQ(FilesBelow(out + "/images").size(), num_pictures) << undistorted.ToString();
}

}  // namespace
}  // namespace haustra::end_to_end
