#include "tools/command/console.h"

#include <gtest/gtest.h>

#include "tools/command/progress_line.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

// What is said on both streams meanwhile.
struct Said {
  std::string out, err;
};
template <typename Function>
Said Listen(Function function) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  function();
  std::string out = testing::internal::GetCapturedStdout();
  return {std::move(out), testing::internal::GetCapturedStderr()};
}

TEST(Console, ErrorsAreSentencesWithoutCodes) {
  int code = 0;
  const Said said = Listen([&] { code = console::Fail("run", InvalidArgument("a.yaml:3: fx: 'wide' is no number")); });
  EXPECT_EQ(said.err, "haustra run: a.yaml:3: fx: 'wide' is no number\n");
  EXPECT_EQ(code, kExitBadData);
}

TEST(Console, ErrorWithoutAMessageSaysItsKind) {
  const Said said = Listen([] { console::Fail("run", Status(StatusCode::kCancelled)); });
  EXPECT_EQ(said.err, "haustra run: cancelled\n");
}

TEST(Console, WhatStandsInTheWayAndWhatCannotBeWrittenDiffer) {
  Listen([] {
    EXPECT_EQ(console::FailWriting("run", FailedPrecondition("x")), kExitInTheWay);
    EXPECT_EQ(console::FailWriting("run", Unavailable("x")), kExitIo);
    EXPECT_EQ(console::FailWriting("run", NotFound("x")), kExitIo);
    EXPECT_EQ(console::FailWriting("run", InvalidArgument("x")), kExitBadData);
  });
}

TEST(Console, QuietKeepsBackAllButAnswersWarningsAndErrors) {
  console::SetQuiet(true);
  const Said said = Listen([] {
    console::Print("answer %d\n", 1);
    console::Tell("written\n");
    console::Note("run", "note");
    ProgressLine().Finish("half");
    console::Warn("run", "look at %s", "this");
    console::Fail("run", NotFound("gone"));
  });
  console::SetQuiet(false);
  EXPECT_EQ(said.out, "answer 1\n");
  EXPECT_EQ(said.err, "haustra run: warning: look at this\nhaustra run: gone\n");
}

TEST(ProgressLine, LogHasLinesAndNoCarriageReturns) {
  const Said said = Listen([] {
    ProgressLine line;
    for (int i = 0; i < 100; ++i) line.Update([] { return std::string("too soon"); });
    line.Finish("100 of 100");
  });
  EXPECT_EQ(said.err, "100 of 100\n");
}

}  // namespace
}  // namespace haustra
