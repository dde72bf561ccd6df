// haustra latency as a vendor's CI calls it. Nothing here depends on the speed of the machine.
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

std::string WriteRequirement(const std::string& text) {
  const std::string path = ScratchFolder() + "/requirement.yaml";
  std::ofstream(path) << text;
  return path;
}

TEST(Latency, MeasuresJudgesAndWritesItsFiles) {
  const std::string out = ScratchFolder() + "/out";
  const std::string requirement = WriteRequirement("frames: 2\nmax_ms: 100000\n");
  const CommandResult run = HaustraOnCpu({"latency", SequenceFolder("standard"), "--rate", HAUSTRA_END_TO_END_RATE,
                                          "--seconds", "6", "--warm-up", "0.5", "--loop", "2", "--out", out,
                                          "--require", requirement, "--stress-cpu", "1", "--stress-memory", "1"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  EXPECT_NE(run.out.find("REQUIREMENT MET"), std::string::npos) << run.ToString();
  EXPECT_NE(run.out.find("end_to_end"), std::string::npos);
  const nlohmann::json latency = ReadJson(out + "/latency.json");
  EXPECT_TRUE(latency.at("met").get<bool>());
  EXPECT_GE(latency.at("frames").get<int>(), 2);
  EXPECT_EQ(latency.at("stages").at("end_to_end").at("count"), latency.at("frames"));
  EXPECT_FALSE(ReadJson(out + "/trace.json").at("traceEvents").empty());
  EXPECT_NE(ReadBytes(out + "/histogram.txt").find("# haustra latency histogram 1"), std::string::npos);
  EXPECT_NE(ReadBytes(out + "/latency.html").find("Requirement met"), std::string::npos);
}

// On any device: that it works beside the measurement, says so, and has gone afterwards.
TEST(Latency, SecondProcessOnTheDeviceWorksBesideTheMeasurement) {
  const std::string out = ScratchFolder() + "/out";
  const CommandResult run =
      HaustraOnCpu({"latency", SequenceFolder("standard"), "--rate", HAUSTRA_END_TO_END_RATE, "--seconds", "3",
                    "--warm-up", "0", "--loop", "1", "--out", out, "--stress-gpu-process"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  EXPECT_NE(ReadBytes(out + "/latency.json").find("a second process on the vision device"), std::string::npos);
}

TEST(Latency, SecondProcessWithoutADeviceIsToldBeforeAnythingIsMeasured) {
  const CommandResult run = Haustra({"latency", "--occupy", "720x540", "--device", "none"});
  EXPECT_NE(run.exit_code, 0);
  EXPECT_NE(run.err.find("none"), std::string::npos) << run.ToString();
}

TEST(Latency, RequirementThatIsNotMetFailsTheCommand) {
  const std::string requirement = WriteRequirement("p50_ms: 0\n");
  const CommandResult run = HaustraOnCpu({"latency", SequenceFolder("standard"), "--rate", HAUSTRA_END_TO_END_RATE,
                                          "--seconds", "3", "--warm-up", "0", "--loop", "1", "--require", requirement});
  EXPECT_EQ(run.exit_code, 1) << run.ToString();
  EXPECT_NE(run.out.find("REQUIREMENT NOT MET"), std::string::npos) << run.ToString();
}

TEST(Latency, BadRequirementIsRefusedWithItsLineBeforeAnythingRuns) {
  const std::string requirement = WriteRequirement("misses: 0\nfast: yes\n");
  const CommandResult run = HaustraOnCpu({"latency", "/no/such/sequence", "--require", requirement});
  EXPECT_EQ(run.exit_code, 78) << run.ToString();
  EXPECT_NE(run.err.find("requirement.yaml:2:1: fast: unknown"), std::string::npos) << run.ToString();
}

TEST(Latency, WarmUpThatTakesAllTheTimeIsAWrongArgument) {
  const CommandResult run = HaustraOnCpu({"latency", "/no/such/sequence", "--seconds", "2"});
  EXPECT_EQ(run.exit_code, 64) << run.ToString();
  EXPECT_NE(run.err.find("--seconds 2 leaves nothing after --warm-up 2"), std::string::npos) << run.ToString();
  EXPECT_EQ(HaustraOnCpu({"latency", "/no/such/sequence", "--seconds", "2", "--warm-up", "1"}).exit_code, 66);
}

TEST(Latency, SequenceOrRenderedIsAsked) {
  EXPECT_EQ(Haustra({"latency"}).exit_code, 64);
  EXPECT_EQ(HaustraOnCpu({"latency", SequenceFolder("standard"), "--rendered"}).exit_code, 64);
  EXPECT_NE(HaustraOnCpu({"latency", "/no/such/sequence"}).exit_code, 0);
}

}  // namespace
}  // namespace haustra::end_to_end
