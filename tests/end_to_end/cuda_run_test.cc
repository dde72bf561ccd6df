// Whole runs on the CUDA device, where there is one.
#include <gtest/gtest.h>

#include <string>

#include "platform/exit_codes.h"
#include "tests/end_to_end/command.h"
#include "tests/end_to_end/evaluation.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

TEST(CudaRun, LossesAreRecoveredFrom) {
  const std::string out = ScratchFolder() + "/result";
  const CommandResult run =
      Haustra({"run", SequenceFolder("losses"), "--out", out, "--device", "cuda", "--report", "off", "--quiet"});
  if (run.exit_code == kExitUnavailable) GTEST_SKIP() << run.err;
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  ExpectAtLeast(LossesFloors(), out);
  EXPECT_EQ(ReadJson(out + "/summary.json").at("device").get<std::string>(), "cuda");
}

}  // namespace
}  // namespace haustra::end_to_end
