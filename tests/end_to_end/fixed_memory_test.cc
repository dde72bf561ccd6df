// What a vendor sees of the memory plan: the table, refusals, pools in the summary, and the soak run's verdict.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"
#include "tools/exit_codes.h"

namespace haustra::end_to_end {
namespace {

using testing::HasSubstr;

TEST(FixedMemory, PlanListsEveryPoolAndItsSumIsTheTotal) {
  const CommandResult text = HaustraOnCpu({"plan", "--sequence", SequenceFolder("standard"), "--threads", "2"});
  ASSERT_EQ(text.exit_code, kExitOk) << text.ToString();
  for (const char* word :
       {"profile medium, images 360x270", "keyframes", "map points", "snapshots", "proposals", "feature sets (cpu)",
        "frames in flight", "rings of the session", "memory.max_map_points", "total"}) {
    EXPECT_THAT(text.out, HasSubstr(word));
  }
  const CommandResult json =
      HaustraOnCpu({"plan", "--sequence", SequenceFolder("standard"), "--threads", "2", "--json"});
  ASSERT_EQ(json.exit_code, kExitOk) << json.ToString();
  const nlohmann::json plan = nlohmann::json::parse(json.out);
  std::uint64_t arena = 0, host = 0;
  for (const nlohmann::json& line : plan.at("lines")) {
    const auto bytes = line.at("bytes").get<std::uint64_t>();
    arena += line.at("place") == "host arena" ? bytes : 0;
    host += bytes;
  }
  EXPECT_EQ(plan.at("host_arena_bytes").get<std::uint64_t>(), arena);
  EXPECT_EQ(plan.at("host_bytes").get<std::uint64_t>(), host);
  EXPECT_LT(host, 1'500'000'000u);
}

TEST(FixedMemory, WhatDoesNotFitIsRefusedBeforeTheStartAndNamed) {
  const std::string out = ScratchFolder() + "/out";
  for (const std::string command : {"plan", "run"}) {
    std::vector<std::string> arguments = {command, "--set", "memory.max_map_points=9000000"};
    if (command == "plan") {
      arguments.insert(arguments.end(), {"--sequence", SequenceFolder("standard")});
    } else {
      arguments.insert(arguments.end(), {SequenceFolder("standard"), "--out", out});
    }
    const CommandResult result = Haustra(arguments);
    EXPECT_EQ(result.exit_code, kExitConfig) << result.ToString();
    EXPECT_THAT(result.err, HasSubstr("'map points'"));
    EXPECT_THAT(result.err, HasSubstr("memory.max_map_points"));
    EXPECT_THAT(result.err, HasSubstr("memory.max_host_mb allows 1800.0 MB"));
  }
}

TEST(FixedMemory, SummaryHasPoolsEvictionsAndTheTrackingThread) {
  const nlohmann::json summary = nlohmann::json::parse(ReadBytes(ResultFolder("losses") + "/summary.json"));
  const nlohmann::json& pools = summary.at("memory").at("pools");
  EXPECT_EQ(pools.at("keyframes").at("capacity").get<int>(), 1500);
  EXPECT_EQ(pools.at("keyframes").at("used").get<int>(), summary.at("keyframes").get<int>());
  EXPECT_GE(pools.at("keyframes").at("peak").get<int>(), pools.at("keyframes").at("used").get<int>());
  EXPECT_EQ(pools.at("keyframes").at("refused").get<int>(), 0);
  EXPECT_EQ(summary.at("memory").at("evicted").at("keyframes").get<int>(), 0);
  const nlohmann::json& later = summary.at("tracking_thread").at("later_frames");
  EXPECT_TRUE(later.contains("minor_faults"));
  if (later.contains("heap_calls")) {
    EXPECT_EQ(later.at("heap_calls").get<int>(), 0);
    EXPECT_EQ(summary.at("tracking_thread").at("first_frame").at("heap_calls").get<int>(), 0);
  }
}

TEST(FixedMemory, TinyPoolKeepsTheCoverage) {
  const std::string out = ScratchFolder() + "/out";
  const CommandResult result =
      HaustraOnCpu({"run", SequenceFolder("losses"), "--out", out, "--set", "memory.max_keyframes=20"});
  ASSERT_EQ(result.exit_code, kExitOk) << result.ToString();
  const nlohmann::json tight = nlohmann::json::parse(ReadBytes(out + "/summary.json"));
  const nlohmann::json plenty = nlohmann::json::parse(ReadBytes(ResultFolder("losses") + "/summary.json"));
  EXPECT_GT(plenty.at("memory").at("pools").at("keyframes").at("peak").get<int>(), 20);
  EXPECT_EQ(tight.at("memory").at("pools").at("keyframes").at("peak").get<int>(), 20);
  // In one small map nearly all is near the scope: what cannot make room is refused, and both are counted.
  EXPECT_GT(tight.at("memory").at("evicted").at("keyframes").get<int>() +
                tight.at("memory").at("pools").at("keyframes").at("refused").get<int>(),
            0);
  EXPECT_GE(tight.at("coverage").get<double>(), plenty.at("coverage").get<double>() - 3.0);  // 2.2 measured
  EXPECT_THAT(result.out, ::testing::AnyOf(HasSubstr("made room"), HasSubstr("full")));
}

TEST(FixedMemory, ShortSoakPassesAndOneWithoutSamplesIsRefused) {
  const std::string csv = ScratchFolder() + "/soak.csv";
  // The solver's memory is still filling: what is allowed is no measure of what is right in a long run.
  const CommandResult passed =
      HaustraOnCpu({"soak", SequenceFolder("standard"), "--minutes", "0.2", "--interval", "0.5", "--warm-up", "6",
                    "--mode", "sequential", "--max-growth-mb", "200", "--max-latency-ratio", "100", "--csv", csv});
  EXPECT_EQ(passed.exit_code, kExitOk) << passed.ToString();
  EXPECT_THAT(passed.out, HasSubstr("passed: resident memory"));
  CsvRows samples = ReadCsv(csv);
  ASSERT_GT(samples.size(), 20u);
  int num_frames = 0;
  for (auto& sample : samples) num_frames += std::stoi(sample["frames"]);
  // Back and forth: more than the sequence has.
  EXPECT_GT(num_frames, 280);
  EXPECT_GT(std::stod(samples.back()["rss_mb"]), 10.0);
  EXPECT_EQ(samples.back()["procedure"], "0");
  const CommandResult nothing = HaustraOnCpu({"soak", SequenceFolder("standard"), "--minutes", "0.02", "--warm-up", "0",
                                              "--interval", "60", "--mode", "sequential"});
  EXPECT_EQ(nothing.exit_code, kExitUsage) << nothing.ToString();
  EXPECT_THAT(nothing.err, HasSubstr("leaves 0 of 8 samples"));
}

TEST(FixedMemory, SoakBeginsAndEndsProcedures) {
  const std::string csv = ScratchFolder() + "/soak.csv";
  const CommandResult passed = HaustraOnCpu({"soak", SequenceFolder("standard"), "--minutes", "0.15", "--procedure",
                                             "0.05", "--interval", "0.2", "--warm-up", "1", "--mode", "sequential",
                                             "--max-growth-mb", "200", "--max-latency-ratio", "100", "--csv", csv});
  EXPECT_EQ(passed.exit_code, kExitOk) << passed.ToString();
  EXPECT_THAT(passed.out, HasSubstr("in 3 procedures"));
  CsvRows samples = ReadCsv(csv);
  ASSERT_GT(samples.size(), 30u);
  // Sequential: the same frames in an empty engine give the same pools.
  std::vector<std::vector<std::string>> pools(3);
  for (auto& sample : samples) {
    pools.at(std::stoi(sample["procedure"]))
        .push_back(sample["keyframes"] + " " + sample["map_points"] + " " + sample["free_feature_sets"]);
  }
  EXPECT_EQ(pools[0], pools[1]);
  EXPECT_EQ(pools[0], pools[2]);
}

TEST(FixedMemory, SoakAsksForASequenceOrToRenderOne) {
  EXPECT_EQ(Haustra({"soak"}).exit_code, kExitUsage);
  EXPECT_EQ(HaustraOnCpu({"soak", SequenceFolder("standard"), "--rendered"}).exit_code, kExitUsage);
}

}  // namespace
}  // namespace haustra::end_to_end
