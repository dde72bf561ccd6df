#include "tools/service/control_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "platform/control/control_protocol.h"
#include "tests/tools/command/call_command.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

// `haustra control WORDS`, where no daemon is.
CommandAnswer CallControl(std::vector<std::string> words) {
  words.insert(words.begin(), {"control", "--folder", "/nonexistent"});
  return CallCommand({AddControlCommand}, words);
}

TEST(ControlCommand, RequestMayBeOneWordOrSeveral) {
  // What is right with it only a daemon would answer.
  EXPECT_EQ(CallControl({"mark", "10", "20", "polyp"}).code, kExitUnavailable);
  EXPECT_EQ(CallControl({"mark 10 20 polyp"}).code, kExitUnavailable);
  const CommandAnswer wrong = CallControl({"save a/b"});
  EXPECT_EQ(wrong.code, kExitUsage);
  EXPECT_THAT(wrong.err, HasSubstr("is not a name"));
}

TEST(ControlCommand, UnknownRequestIsAnsweredWithTheForms) {
  const CommandAnswer answer = CallControl({"dance"});
  EXPECT_EQ(answer.code, kExitUsage);
  EXPECT_THAT(answer.err, HasSubstr(ControlForms()));
}

}  // namespace
}  // namespace haustra
