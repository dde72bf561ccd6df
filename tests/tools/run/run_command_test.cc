// What `haustra run` says, in the process of the test.
#include "tools/run/run_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "capture/codec/image_codec.h"
#include "tests/capture/temp_folder.h"
#include "tests/tools/command/call_command.h"
#include "tools/command/console.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"
#include "tools/render/render_command.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(RunCommand, RefusedMarksAreWarnings) {
  const TempFolder root;
  const std::string colon = root.Path("colon"), marks = root.Path("marks.csv");
  ASSERT_EQ(CallCommand({AddRenderCommand}, {"render", colon, "--seconds", "0.4", "--size", "360x270"}).code, kExitOk);
  std::ofstream(marks) << "frame,u,v,label\n9000,20,20,polyp\n";
  console::SetQuiet(true);
  const CommandAnswer answer = CallCommand({AddRunCommand}, {"run", colon, "--out", root.Path("out"), "--device", "cpu",
                                                             "--report", "off", "--marks", marks});
  console::SetQuiet(false);
  EXPECT_EQ(answer.code, kExitOk);
  EXPECT_THAT(answer.err, HasSubstr("haustra run: warning: mark polyp in frame 9000 is refused: the run ended before "
                                    "its frame came\n"));
  EXPECT_THAT(answer.out, Not(HasSubstr("polyp"))) << "once is enough";
}

// What is in maps that go again is not known before the end.
TEST(RunCommand, ProgressSaysThatItCountsPosesSoFar) {
  const TempFolder root;
  const std::string colon = root.Path("colon");
  ASSERT_EQ(CallCommand({AddRenderCommand}, {"render", colon, "--seconds", "0.4", "--size", "360x270"}).code, kExitOk);
  const CommandAnswer answer =
      CallCommand({AddRunCommand}, {"run", colon, "--out", root.Path("out"), "--device", "cpu", "--report", "off"});
  EXPECT_EQ(answer.code, kExitOk);
  EXPECT_THAT(answer.err, HasSubstr("with a pose so far"));
  EXPECT_THAT(answer.err, Not(HasSubstr("show the same scene")));
}

// The frame in half its width, and beside it again from a little to the right.
void MakeSideBySide(const std::string& path) {
  const Result<Image> read = ReadImage(path, ChannelChoice::kGrey);
  ASSERT_TRUE(read.ok());
  const int half = read->width() / 2;
  constexpr int kDisparityPx = 8;
  Image both(2 * half, read->height(), PixelFormat::kGrey8);
  for (int y = 0; y < both.height(); ++y) {
    for (int x = 0; x < half; ++x) {
      both.row(y)[x] = read->row(y)[2 * x];
      both.row(y)[half + x] = read->row(y)[2 * std::min(x + kDisparityPx, half - 1)];
    }
  }
  ASSERT_TRUE(WritePng(path, both.view()).ok());
}

TEST(RunCommand, WarnsOnceOfTwoViewsInEachPicture) {
  const TempFolder root;
  const std::string colon = root.Path("colon");
  ASSERT_EQ(CallCommand({AddRenderCommand}, {"render", colon, "--seconds", "0.4", "--size", "720x270"}).code, kExitOk);
  for (const auto& entry : std::filesystem::directory_iterator(colon + "/frames")) MakeSideBySide(entry.path());
  console::SetQuiet(true);
  const CommandAnswer answer =
      CallCommand({AddRunCommand}, {"run", colon, "--out", root.Path("out"), "--device", "cpu", "--report", "off"});
  console::SetQuiet(false);
  EXPECT_EQ(answer.code, kExitOk);
  EXPECT_THAT(answer.err, HasSubstr("haustra run: warning: " + colon +
                                    ": left and right half of the pictures show the "
                                    "same scene."));
  EXPECT_THAT(answer.err, HasSubstr("-vf crop=iw/2:ih:0:0 "));
  EXPECT_EQ(answer.err.find("same scene"), answer.err.rfind("same scene"));
}

// For a process of its own, which is told to stop before the first frame. The code of the run, or 1 where the folder of
// the results is not as it was before.
int RunStoppedBeforeTheFirstFrame(bool has_earlier_run) {
  const TempFolder root;
  const std::string colon = root.Path("colon"), out = root.Path("out");
  EXPECT_EQ(CallCommand({AddRenderCommand}, {"render", colon, "--seconds", "0.2", "--size", "360x270"}).code, kExitOk);
  if (has_earlier_run) {
    std::filesystem::create_directories(out);
    std::ofstream(out + "/frames.csv") << "earlier";
  }
  HandleSignals("run");
  CatchStopSignals();
  std::raise(SIGINT);
  const CommandAnswer answer =
      CallCommand({AddRunCommand}, {"run", colon, "--out", out, "--overwrite", "--device", "cpu"});
  std::fputs(answer.err.c_str(), stderr);
  EXPECT_EQ(std::filesystem::exists(out), has_earlier_run);
  if (has_earlier_run) {
    std::string kept;
    std::ifstream(out + "/frames.csv") >> kept;
    EXPECT_EQ(kept, "earlier");
    const std::filesystem::directory_iterator entries(out);
    EXPECT_EQ(std::distance(begin(entries), end(entries)), 1);
  }
  return testing::Test::HasFailure() ? 1 : answer.code;
}

TEST(RunCommand, StoppedBeforeTheFirstFrameLeavesTheFolderAsItWas) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  for (const bool has_earlier_run : {false, true}) {
    EXPECT_EXIT(std::exit(RunStoppedBeforeTheFirstFrame(has_earlier_run)), testing::ExitedWithCode(kExitStopped),
                "haustra run: warning: stopped before the first frame");
  }
}

}  // namespace
}  // namespace haustra
