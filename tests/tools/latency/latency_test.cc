// The parts of haustra latency: histogram against sorted values, requirement files, the loop, the trace, the board.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "engine/geometry/rng.h"
#include "tests/tools/run/scripted_colon.h"
#include "tools/latency/board_state.h"
#include "tools/latency/latency_histogram.h"
#include "tools/latency/latency_page.h"
#include "tools/latency/latency_record.h"
#include "tools/latency/looped_source.h"
#include "tools/latency/requirement.h"
#include "tools/latency/trace_json.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(LatencyHistogram, QuantilesAreWithinABucketOfTheSortedValues) {
  Rng rng(3);
  LatencyHistogram histogram;
  std::vector<std::int64_t> values;
  for (int i = 0; i < 20000; ++i) {
    values.push_back(static_cast<std::int64_t>(std::exp(rng.Uniform(0.0, 24.0))));  // 1 ns to 26 s
    histogram.Add(Duration(values.back()));
  }
  std::sort(values.begin(), values.end());
  for (const double share : {0.0, 0.01, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank = static_cast<std::size_t>(std::max(1.0, std::ceil(share * 20000)));
    const auto truth = static_cast<double>(values[rank - 1]);
    const auto found = static_cast<double>(histogram.Quantile(share).count());
    EXPECT_GE(found, truth) << share;
    EXPECT_LE(found, truth * (1.0 + 1.0 / 64) + 1) << share;
  }
  EXPECT_EQ(histogram.max().count(), values.back());
  EXPECT_EQ(histogram.count(), 20000u);
}

TEST(LatencyHistogram, EveryValueLiesInItsBucketAndBucketsAreInOrder) {
  for (std::int64_t value = 0; value < 100000; value = value < 300 ? value + 1 : value * 65 / 64) {
    LatencyHistogram histogram;
    histogram.Add(Duration(value));
    histogram.Add(Duration(value + value / 32 + 1));
    const auto buckets = histogram.Buckets();
    ASSERT_FALSE(buckets.empty());
    EXPECT_GE(buckets[0].upper.count(), value);
    EXPECT_LE(buckets[0].upper.count(), value + value / 64 + 1);
    if (buckets.size() > 1) {
      EXPECT_LT(buckets[0].upper, buckets[1].upper);
    }
  }
}

TEST(LatencyHistogram, OddValuesDoNoHarm) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.Quantile(0.5), Duration{0});
  histogram.Add(Duration(-5));
  histogram.Add(Duration::max());
  EXPECT_EQ(histogram.count(), 2u);
  EXPECT_EQ(histogram.Quantile(0.1), Duration{0});
}

TEST(LatencyHistogram, FileHasALineABucketAndSharesUpToOne) {
  LatencyHistogram histogram;
  for (int i = 1; i <= 10; ++i) histogram.Add(milliseconds(i));
  std::istringstream text(ToFileText("end_to_end", histogram));
  std::string line, last;
  int num_lines = 0;
  while (std::getline(text, line)) {
    if (line[0] == '#') continue;
    last = line;
    ++num_lines;
  }
  EXPECT_EQ(num_lines, 10);
  EXPECT_THAT(last, HasSubstr("end_to_end\t"));
  EXPECT_THAT(last, HasSubstr("\t1\t1.000000000"));
}

TEST(Requirement, LimitsAreReadAndJudged) {
  const Result<Requirement> requirement =
      ParseRequirement("p99.9_ms: 25\nmisses: 0   # none\nframes: 30000\n", "r.yaml");
  ASSERT_TRUE(requirement.ok()) << requirement.status().ToString();
  LatencyFigureValues values;
  values.p999_ms = 24.9;
  values.misses = 1;
  values.frames = 30000;
  const std::vector<RequirementLine> lines = Judge(*requirement, values);
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].name, "p99.9_ms");
  EXPECT_TRUE(lines[0].is_met);
  EXPECT_EQ(lines[1].name, "misses");
  EXPECT_FALSE(lines[1].is_met);
  EXPECT_TRUE(lines[2].is_met);
  values.frames = 29999;
  EXPECT_FALSE(Judge(*requirement, values)[2].is_met);
}

TEST(Requirement, MistakesNameLineAndKey) {
  const struct {
    const char* text;
    const char* message;
  } cases[] = {
      {"p99_ms: 25\nmises: 0\n", "r.yaml:2:1: mises: unknown; keys: p50_ms"},
      {"p99_ms: 25\np99_ms: 26\n", "r.yaml:2:1: p99_ms: given twice"},
      {"misses: none\n", "r.yaml:1:9: misses: not a number of at least 0"},
      {"misses: -1\n", "r.yaml:1:9: misses: not a number"},
      {"misses: .nan\n", "misses: not a number"},
      {"misses: 1e999\n", "misses: not a number"},
      {"misses: [1]\n", "misses: not a number"},
      {"- p99_ms\n", "r.yaml:1:1: not a map"},
      {"a: b: c\n", "r.yaml:1:"},
      {"", "r.yaml: requires nothing"},
      {"# nothing\n", "r.yaml: requires nothing"},
  };
  for (const auto& c : cases) {
    const Result<Requirement> requirement = ParseRequirement(c.text, "r.yaml");
    ASSERT_EQ(requirement.code(), StatusCode::kFailedPrecondition) << c.text;
    EXPECT_THAT(requirement.status().message(), HasSubstr(c.message));
  }
  EXPECT_EQ(LoadRequirement("/no/such/file.yaml").code(), StatusCode::kNotFound);
  EXPECT_EQ(LoadRequirement("/").code(), StatusCode::kDataLoss);
}

TEST(LoopedSource, GoesThereAndBackAgainWithTimeGoingOn) {
  test::ScriptedColon colon;
  colon.Occlude(3);
  colon.Damage("unreadable");
  colon.Occlude(5);
  const auto loop = LoopedSource::Load(colon.source(), 4);
  ASSERT_TRUE(loop.ok());
  EXPECT_EQ((*loop)->num_loaded(), 4u);
  const std::uint8_t* first[7];
  for (std::uint32_t i = 0; i < 14; ++i) {
    const Result<Frame> frame = (*loop)->Next(kNoDeadline);
    ASSERT_TRUE(frame.ok());
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->image.format, (*loop)->pixel_format());
    EXPECT_EQ(frame->timestamp, TimePoint(i * test::kFramePeriod));
    if (i < 7) {
      first[i] = frame->image.data;
    } else if (i < 13) {
      EXPECT_EQ(frame->image.data, first[i - 6]) << i;
    }
  }
  EXPECT_EQ(first[4], first[2]);
  EXPECT_EQ(first[5], first[1]);
  EXPECT_EQ(first[6], first[0]);
  test::ScriptedColon single;
  single.Occlude(1);
  EXPECT_EQ(LoopedSource::Load(single.source(), 100).code(), StatusCode::kFailedPrecondition);
}

FrameOutcome Outcome(std::uint32_t index, int latency_ms, Rung rung = Rung::kFull) {
  FrameOutcome outcome;
  outcome.result.frame_index = index;
  outcome.result.state = TrackingState::kTracking;
  outcome.result.rung = rung;
  outcome.result.times[0] = milliseconds(6);
  outcome.result.times[2] = milliseconds(2);
  outcome.due = TimePoint(index * milliseconds(40));
  outcome.deadline = outcome.due + milliseconds(40);
  outcome.begin = outcome.due + milliseconds(1);
  outcome.latency = milliseconds(latency_ms);
  outcome.tracking = milliseconds(latency_ms - 1);
  outcome.is_late = latency_ms > 40;
  outcome.capture_begin = outcome.due - milliseconds(10);
  outcome.capture = milliseconds(3);
  outcome.use.minor_faults = 1;
  return outcome;
}

TEST(LatencyRecord, CountsWhatComesAfterTheWarmUpAndStopsWhenItHasEnough) {
  int num_starts = 0, num_stops = 0;
  LatencyRecord record(
      10, 5, 20, [&num_starts] { ++num_starts; }, [&num_stops] { ++num_stops; });
  EXPECT_EQ(num_starts, 0);
  record.OnStart({});
  EXPECT_EQ(num_starts, 1) << "the time begins when frames come";
  for (std::uint32_t i = 0; i < 40; ++i)
    record.OnFrame(Outcome(i, i == 30 ? 50 : 10, i == 20 ? Rung::kPredicted : Rung::kFull));
  FrameOutcome dropped = Outcome(40, 1);
  dropped.is_dropped = true;
  record.OnFrame(dropped);
  const LatencyFigureValues values = record.Values();
  EXPECT_EQ(values.frames, 30);
  EXPECT_EQ(values.misses, 1);
  EXPECT_EQ(values.drops, 1);
  EXPECT_EQ(values.predicted, 1);
  EXPECT_EQ(values.reduced, 1);
  EXPECT_EQ(values.page_faults, 30);
  EXPECT_EQ(values.max_ms, 50);
  EXPECT_NEAR(values.p50_ms, 10, 0.2);
  EXPECT_EQ(record.num_warm_up(), 10u);
  EXPECT_EQ(num_stops, 1);
  EXPECT_EQ(record.last_frames().size(), 5u);
  EXPECT_EQ(record.last_frames().back().result.frame_index, 39u);
  EXPECT_EQ(record.worst_of_second().size(), 2u);
  EXPECT_EQ(record.worst_of_second()[0], 50.0f);
}

TEST(Trace, ShowsCaptureTrackingStagesAndMappingWhereTheyRan) {
  LatencyRecord record(0, 100, 0, {}, {});
  for (std::uint32_t i = 0; i < 3; ++i) record.OnFrame(Outcome(i, i == 2 ? 45 : 12));
  MappingTimes times;
  times.start = TimePoint(milliseconds(20));
  times.insert = milliseconds(5);
  times.bundle = milliseconds(30);
  record.OnMapped(times);
  const nlohmann::json trace = nlohmann::json::parse(MakeTraceJson(record));
  int num_frames = 0, num_missed = 0;
  double bundle_at = -1, motion_at = -1;
  for (const auto& event : trace.at("traceEvents")) {
    const std::string name = event.at("name");
    num_frames += name.rfind("frame ", 0) == 0;
    num_missed += name == "deadline MISSED";
    if (name == "bundle") bundle_at = event.at("ts");
    if (name == "motion" && motion_at < 0) motion_at = event.at("ts");
  }
  EXPECT_EQ(num_frames, 3);
  EXPECT_EQ(num_missed, 1);
  // The first capture begins 10 ms before the first frame is due, which is the origin.
  EXPECT_NEAR(bundle_at, 35000, 1e-6);
  EXPECT_NEAR(motion_at, 17000, 1e-6);
}

TEST(LatencyReport, NameThatIsNotUtf8CostsNoReport) {
  LatencyRecord record(0, 100, 0, {}, {});
  record.OnFrame(Outcome(0, 12));
  LatencyReport report;
  report.title = "sequence caf\xe9";
  report.record = &record;
  EXPECT_EQ(nlohmann::json::parse(ToJson(report))["title"], "sequence caf\xef\xbf\xbd");
}

TEST(LatencyReport, TextJsonAndPageSayTheSame) {
  LatencyRecord record(0, 100, 0, {}, {});
  for (std::uint32_t i = 0; i < 100; ++i) record.OnFrame(Outcome(i, i == 50 ? 45 : 12));
  LatencyReport report;
  report.title = "a <b> title";
  report.deadline_ms = 40;
  report.record = &record;
  report.board_before = {{"cpu 0", "1500 MHz"}};
  report.board_after = {{"cpu 0", "1200 MHz"}};
  report.verdict = Judge(*ParseRequirement("misses: 0\np50_ms: 13\n", "r"), record.Values());
  EXPECT_FALSE(report.is_met());
  const std::string text = ToText(report), page = MakeLatencyPage(report);
  const nlohmann::json json = nlohmann::json::parse(ToJson(report));
  EXPECT_THAT(text, HasSubstr("REQUIREMENT NOT MET"));
  EXPECT_THAT(text, HasSubstr("1500 MHz; afterwards 1200 MHz"));
  EXPECT_FALSE(json.at("met").get<bool>());
  EXPECT_EQ(json.at("misses").get<int>(), 1);
  EXPECT_TRUE(json.at("verdict").at("p50_ms").at("met").get<bool>());
  EXPECT_THAT(page, HasSubstr("a &lt;b&gt; title"));
  EXPECT_THAT(page, HasSubstr("Requirement not met"));
  EXPECT_THAT(page, HasSubstr("new Chart('histogram'"));
}

TEST(LatencyReport, MeasurementWithoutAFrameMeetsNoRequirement) {
  LatencyRecord record(10, 100, 0, {}, {});
  for (std::uint32_t i = 0; i < 10; ++i) record.OnFrame(Outcome(i, 12));
  LatencyReport report;
  report.record = &record;
  report.verdict = Judge(*ParseRequirement("max_ms: 40\nmisses: 0\n", "r"), record.Values());
  EXPECT_FALSE(report.is_met());
  EXPECT_THAT(ToText(report), HasSubstr("REQUIREMENT NOT MET"));
  EXPECT_FALSE(nlohmann::json::parse(ToJson(report)).at("met").get<bool>());
  EXPECT_THAT(MakeLatencyPage(report), HasSubstr("Requirement not met"));
}

TEST(BoardState, ReadsWhatTheBoardHasAndNothingElse) {
  namespace fs = std::filesystem;
  const fs::path root = fs::path(::testing::TempDir()) / "haustra_board";
  fs::remove_all(root);
  const auto write = [&](const std::string& path, const std::string& text) {
    fs::create_directories((root / path).parent_path());
    std::ofstream(root / path) << text;
  };
  EXPECT_TRUE(ReadBoardState(root.string()).empty());
  write("sys/devices/system/cpu/cpufreq/policy0/scaling_cur_freq", "1500000\n");
  write("sys/devices/system/cpu/cpufreq/policy0/scaling_max_freq", "2201600\n");
  write("sys/devices/system/cpu/cpufreq/policy0/scaling_governor", "schedutil\n");
  write("sys/devices/system/cpu/cpufreq/policy0/affected_cpus", "0 1 2 3\n");
  write("sys/class/devfreq/17000000.gpu/cur_freq", "918000000\n");
  write("sys/class/thermal/thermal_zone0/temp", "48500\n");
  write("sys/class/thermal/thermal_zone0/type", "cpu-thermal\n");
  write("var/lib/nvpmodel/status", "pmode:0002\n");
  EXPECT_THAT(ReadBoardState(root.string()),
              ::testing::ElementsAre(::testing::Pair("nvpmodel", "pmode:0002"),
                                     ::testing::Pair("cpu 0 1 2 3", "1500 MHz of 2202 MHz, schedutil"),
                                     ::testing::Pair("17000000.gpu", "918 MHz"),
                                     ::testing::Pair("temperature cpu-thermal", "48 C")));
  fs::remove_all(root);
}

}  // namespace
}  // namespace haustra
