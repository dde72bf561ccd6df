// What `haustra run` says, in the process of the test.
#include "tools/run/run_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "tests/capture/temp_folder.h"
#include "tests/tools/command/call_command.h"
#include "tools/command/console.h"
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

}  // namespace
}  // namespace haustra
