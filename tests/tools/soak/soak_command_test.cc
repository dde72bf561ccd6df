#include "tools/soak/soak_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/tools/command/call_command.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

// `haustra soak SEQUENCE OPTIONS`, of a sequence that is not there.
CommandAnswer CallSoak(std::vector<std::string> options) {
  options.insert(options.begin(), {"soak", "/nonexistent/sequence", "--mode", "sequential"});
  return CallCommand({AddSoakCommand}, options);
}

TEST(SoakCommand, RunThatCannotBeJudgedAtItsEndIsRefusedAtItsStart) {
  const CommandAnswer answer = CallSoak({"--minutes", "2.1"});
  EXPECT_EQ(answer.code, kExitUsage);
  EXPECT_THAT(answer.err, HasSubstr("--minutes 2.1 in procedures of 126 s leaves 1 of 8 samples that are needed, after "
                                    "--warm-up 120 at --interval 10; give more"));
  EXPECT_THAT(CallSoak({"--minutes", "1"}).err, HasSubstr("leaves 0 of 8 samples"));
  EXPECT_THAT(CallSoak({"--minutes", "0.5", "--warm-up", "0", "--interval", "60"}).err, HasSubstr("leaves 0 of 8"));
}

TEST(SoakCommand, RunThatHasEnoughSamplesBegins) {
  // One has samples from 120 to 180 s, the other to 190 s.
  EXPECT_EQ(CallSoak({"--minutes", "3.1"}).code, kExitUsage);
  EXPECT_EQ(CallSoak({"--minutes", "3.2"}).code, kExitNoInput);
  // Of several procedures the first is not judged.
  std::vector<std::string> options = {"--procedure", "0.1", "--warm-up", "2", "--interval", "1", "--minutes", "0.3"};
  EXPECT_EQ(CallSoak(options).code, kExitNoInput);
  options.back() = "0.2";
  EXPECT_EQ(CallSoak(options).code, kExitUsage);
}

}  // namespace
}  // namespace haustra
