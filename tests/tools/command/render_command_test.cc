#include "tools/render/render_command.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/capture/temp_folder.h"
#include "tests/tools/command/call_command.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

// Exit code of `haustra render ARGUMENTS`.
int Render(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "render");
  return CallCommand({AddRenderCommand}, arguments).code;
}

TEST(RenderCommand, WrongArgumentsAreUsageErrors) {
  const TempFolder root;
  const std::string out = root.Path("out");
  EXPECT_EQ(Render({out, "--preset", "nasal"}), kExitUsage);
  EXPECT_EQ(Render({out, "--size", "720"}), kExitUsage);
  EXPECT_EQ(Render({out, "--size", "720x540x3"}), kExitUsage);
  EXPECT_EQ(Render({out, "--events", "smoke@2"}), kExitUsage);
  EXPECT_EQ(Render({out, "--seconds", "-3"}), kExitUsage);
  EXPECT_EQ(Render({out, "--calibration-error", "2 %"}), kExitUsage);
  EXPECT_EQ(Render({out, "--breathing", "16"}), kExitUsage);
  EXPECT_EQ(Render({out, "--contraction", "-1"}), kExitUsage);
  EXPECT_EQ(Render({out, "--tangential", "20"}), kExitUsage);
  EXPECT_EQ(Render({out, "--exposure", "1.5"}), kExitUsage);
  EXPECT_EQ(Render({out, "--readout", "2"}), kExitUsage);
  EXPECT_EQ(Render({out, "--field-lag", "1"}), kExitUsage);
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(RenderCommand, MissingFolderArgumentIsRefusedByTheParser) {
  CLI::App app;
  std::function<int()> action;
  AddRenderCommand(app, action);
  const char* argv[] = {"haustra", "render"};
  EXPECT_THROW(app.parse(2, argv), CLI::ParseError);
}

TEST(RenderCommand, WritesASequence) {
  const TempFolder root;
  const std::string out = root.Path("out");
  const CommandAnswer answer = CallCommand({AddRenderCommand}, {"render", out, "--seconds", "0.2", "--size", "160x120",
                                                                "--events", "water@0.05+0.1", "--seed", "7"});
  EXPECT_EQ(answer.code, kExitOk);
  EXPECT_NE(answer.out.find("seed 7, 1 event, "), std::string::npos) << answer.out;
  for (const char* name :
       {"frames/000004.jpg", "times.txt", "calib.yaml", "mask.png", "groundtruth.txt", "events.csv", "revisits.csv"}) {
    EXPECT_TRUE(std::filesystem::exists(out + "/" + name)) << name;
  }
  EXPECT_EQ(Render({out, "--seconds", "0.2", "--size", "160x120"}), kExitInTheWay);
}

}  // namespace
}  // namespace haustra
