// Real-time mode over a whole sequence. Nothing here depends on the speed of the machine but one generous floor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

using ::testing::HasSubstr;

// Every frame has one row, in order, and the states add up to the summary.
void ExpectEveryFrameAccountedFor(const std::string& out, std::size_t num_frames) {
  CsvRows frames = ReadCsv(out + "/frames.csv");
  ASSERT_EQ(frames.size(), num_frames);
  int num_dropped = 0;
  std::size_t num_tracking = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i]["frame_idx"], std::to_string(i));
    num_dropped += frames[i]["state"] == "dropped";
    num_tracking += frames[i]["state"] == "tracking";
    EXPECT_GE(std::stod(frames[i]["frame_ms"]), 0.0);
  }
  const nlohmann::json summary = ReadJson(out + "/summary.json");
  EXPECT_EQ(summary.at("frames").get<std::size_t>(), num_frames);
  EXPECT_EQ(summary.at("dropped").get<int>(), num_dropped);
  EXPECT_EQ(summary.at("mode").get<std::string>(), "realtime");
  EXPECT_EQ(ReadTum(out + "/trajectory/live.tum").size(), num_tracking);
}

TEST(RealTimeRun, SlowPaceMapsTheSequence) {
  const std::string scratch = ScratchFolder();
  const std::string out = scratch + "/out";
  const CommandResult run = HaustraOnCpu(
      {"run", SequenceFolder("standard"), "--out", out, "--mode", "realtime", "--rate", HAUSTRA_END_TO_END_RATE});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  ExpectEveryFrameAccountedFor(out, ReadCsv(ResultFolder("standard") + "/frames.csv").size());
  EXPECT_NE(run.out.find("coverage"), std::string::npos) << run.ToString();

  const CommandResult evaluate =
      Haustra({"evaluate", out, "--groundtruth", SequenceFolder("standard") + "/groundtruth.txt", "--json",
               scratch + "/evaluation.json"});
  ASSERT_EQ(evaluate.exit_code, 0) << evaluate.ToString();
  const nlohmann::json evaluation = ReadJson(scratch + "/evaluation.json");
  EXPECT_GE(evaluation.at("coverage").get<double>(), 40.0) << "91 on an idle machine";
  EXPECT_EQ(evaluation.at("false_merges").get<int>(), 0);
}

// Helpers of tracking run in real time: with all processors theirs, mapping would wait for ever.
TEST(RealTimeRun, ProcessorIsLeftToMappingByEveryCommandThatRunsInRealTime) {
  const int num_processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  if (num_processors == 1) GTEST_SKIP() << "there is one processor only, for tracking and mapping";
  const auto threads = [](int count) { return ", " + std::to_string(count) + (count == 1 ? " thread" : " threads"); };
  const std::string scratch = ScratchFolder(), sequence = scratch + "/sequence";
  CopySequence(SequenceFolder("standard"), sequence, 10);
  const auto run = [&](std::vector<std::string> options) {
    options.insert(options.begin(), {"run", sequence, "--overwrite", "--out", scratch + "/out"});
    return HaustraOnCpu(options).err;
  };
  EXPECT_THAT(run({"--mode", "realtime"}), HasSubstr(threads(num_processors - 1)));
  EXPECT_THAT(run({"--mode", "sequential"}), HasSubstr(threads(num_processors)));
  EXPECT_THAT(run({"--mode", "realtime", "--set", "rt.enabled=false"}), HasSubstr(threads(num_processors)));
  EXPECT_THAT(run({"--mode", "realtime", "--threads", "3"}), HasSubstr(threads(3))) << "as it is told";
  const auto soak = [&](const char* mode) {
    return HaustraOnCpu({"soak", sequence, "--minutes", "0.02", "--interval", "0.1", "--warm-up", "0", "--mode", mode})
        .out;
  };
  EXPECT_THAT(soak("realtime"), HasSubstr(threads(num_processors - 1)));
  EXPECT_THAT(soak("sequential"), HasSubstr(threads(num_processors)));
  EXPECT_THAT(HaustraOnCpu({"latency", sequence, "--seconds", "1", "--warm-up", "0", "--loop", "0.2"}).out,
              HasSubstr(threads(num_processors - 1)));
}

TEST(RealTimeRun, PaceFarTooFastDropsFramesAndEnds) {
  RecordProperty("req", "OVL-001");
  const std::string out = ScratchFolder() + "/out";
  const CommandResult run =
      HaustraOnCpu({"run", SequenceFolder("standard"), "--out", out, "--mode", "realtime", "--rate", "100"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  ExpectEveryFrameAccountedFor(out, ReadCsv(ResultFolder("standard") + "/frames.csv").size());
}

TEST(RealTimeRun, DamagedFramesAreCountedUpToTheLast) {
  const std::string scratch = ScratchFolder();
  const std::string sequence = scratch + "/sequence", out = scratch + "/out";
  CopySequence(SequenceFolder("standard"), sequence, 30);
  for (const int index : {0, 15, 28, 29}) {
    WriteBytes(FramePath(sequence, index), ReadBytes(FramePath(sequence, index)).substr(0, 700));
  }
  const CommandResult run = HaustraOnCpu({"run", sequence, "--out", out, "--mode", "realtime", "--rate", "4"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  ExpectEveryFrameAccountedFor(out, 30);
  EXPECT_EQ(ReadJson(out + "/summary.json").at("damaged").get<int>(), 4);
}

}  // namespace
}  // namespace haustra::end_to_end
