// A tower's picture: the scope's window is a quarter of it, the rest is dark, and nobody says so.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "capture/codec/image_codec.h"
#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

constexpr int kNumSurrounded = 40;

// The picture in the middle of one of twice the width and twice the height.
void Surround(const std::string& path) {
  const Image window = ReadImage(path, ChannelChoice::kAsStored).value();
  Image picture(2 * window.width(), 2 * window.height(), PixelFormat::kBgr8);
  for (int y = 0; y < picture.height(); ++y) std::fill_n(picture.row(y), 3 * picture.width(), std::uint8_t{16});
  for (int y = 0; y < window.height(); ++y) {
    std::copy_n(window.row(y), 3 * window.width(), picture.row(y + window.height() / 2) + 3 * (window.width() / 2));
  }
  ASSERT_TRUE(WritePng(path, picture.view()).ok()) << path;
}

TEST(Surround, ScopeIsFollowedInAQuarterOfThePicture) {
  const std::string folder = ScratchFolder(), sequence = folder + "/sequence", out = folder + "/out";
  CopySequence(SequenceFolder("depth"), sequence, kNumSurrounded);
  std::filesystem::remove(sequence + "/mask.png");
  for (int i = 0; i < kNumSurrounded; ++i) Surround(FramePath(sequence, i));
  for (const auto& [from, to] : {std::pair{"cx: 181.05", "cx: 361.05"}, std::pair{"cy: 133.4", "cy: 268.4"},
                                 std::pair{"width: 360", "width: 720"}, std::pair{"height: 270", "height: 540"}}) {
    ReplaceInFile(sequence + "/calib.yaml", from, to);
  }
  const CommandResult run = HaustraOnCpu({"run", sequence, "--out", out, "--report", "off"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  const CsvRows frames = ReadCsv(out + "/frames.csv");
  const auto num_tracked =
      std::count_if(frames.begin(), frames.end(), [](const auto& frame) { return frame.at("state") == "tracking"; });
  EXPECT_GE(num_tracked, kNumSurrounded * 3 / 4);
}

}  // namespace
}  // namespace haustra::end_to_end
