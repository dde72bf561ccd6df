#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tools/evaluate/number_text.h"
#include "tools/evaluate/report_json.h"
#include "tools/evaluate/report_text.h"
#include "tools/evaluate/run_table.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Evaluation Example(double coverage, double rms_ate) {
  Evaluation e;
  e.name = "results/losses/";
  e.mode = "realtime";
  e.unit = "mm";
  e.frames = 1000;
  e.live_localised = static_cast<std::size_t>(10 * (coverage - 5));
  e.live_coverage = coverage - 5;
  e.localised = static_cast<std::size_t>(10 * coverage);
  e.coverage = coverage;
  e.rms_ate = rms_ate;
  e.max_error = 3 * rms_ate;
  e.maps = 2;
  e.frame_ms = Percentiles{20, 35, 39, 45};
  e.deadline_ms = 40;
  e.deadline_misses = 1;
  MapEvaluation map;
  map.map_id = 3;
  map.frames = 700;
  map.rms_ate = rms_ate;
  map.scene_depth = 35;
  map.rms_ate_percent_of_depth = e.largest_map_rms_ate_percent_of_depth = 100 * rms_ate / 35;
  e.largest_map_rms_ate = rms_ate;
  e.per_map = {map};
  e.mean_map = e.largest_map = MapTable{38, 2844, 4.61, 12.16, 311.3, 39.1};
  JoinEvaluation join;
  join.kind = JoinKind::kRelocalisation;
  join.frame_idx = 512;
  join.verdict = Verdict::kFalse;
  join.reason = "relative position is wrong";
  e.joins = {join};
  e.relocalisations = {3, 2, 1};
  e.false_merges = 1;
  return e;
}

TEST(NumberText, FixedDecimalsAndPadding) {
  EXPECT_EQ(Fixed(1.0 / 3, 3), "0.333");
  EXPECT_EQ(Fixed(std::optional<double>(), 3), "-");
  EXPECT_EQ(Fixed(1e300, 1).size(), 303u);
  EXPECT_EQ(PadLeft("ab", 4), "  ab");
  EXPECT_EQ(PadRight("ab", 4), "ab  ");
  EXPECT_EQ(PadLeft("abcde", 4), "abcde");
}

TEST(ReportJson, HasTheTermsOfTheEvaluation) {
  const nlohmann::json json = nlohmann::json::parse(ToJson(Example(80, 0.35)));
  for (const char* key : {"stages",           "relocalisation_recall",
                          "loop_precision",   "frames",
                          "localised",        "coverage",
                          "visible_coverage", "maps",
                          "merges",           "loops",
                          "relocalisations",  "false_merges",
                          "rms_ate",          "largest_map_frames",
                          "frame_ms",         "dropped",
                          "peak_rss_mb",      "realtime_ratio",
                          "per_map",          "merge_recall",
                          "scene_depth"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["frames"], 1000);
  EXPECT_EQ(json["coverage"], 80.0);
  EXPECT_EQ(json["live_coverage"], 75.0);
  EXPECT_EQ(json["live_localised"], 750);
  EXPECT_TRUE(json["live_visible_coverage"].is_null());
  EXPECT_DOUBLE_EQ(json["largest_map_rms_ate_percent_of_depth"].get<double>(), 1.0);
  EXPECT_EQ(json["per_map"][0]["scene_depth"], 35.0);
  EXPECT_DOUBLE_EQ(json["per_map"][0]["rms_ate_percent_of_depth"].get<double>(), 1.0);
  EXPECT_EQ(json["join_counts"]["recoveries"]["made"], 0);
  EXPECT_EQ(json["rms_ate"], 0.35);
  EXPECT_TRUE(json["visible_coverage"].is_null());
  EXPECT_EQ(json["frame_ms"]["p999"], 39.0);
  EXPECT_EQ(json["relocalisations"], 3);
  EXPECT_EQ(json["join_counts"]["relocalisations"]["precision"], 0.5);
  EXPECT_EQ(json["per_map"][0]["map_id"], 3);
  EXPECT_TRUE(json["per_map"][0]["scale_drift"].is_null());
  EXPECT_EQ(json["joins"][0]["verdict"], "false");
}

TEST(ReportJson, NameThatIsNotUtf8DoesNotBreakIt) {
  Evaluation e = Example(80, 0.35);
  e.name = "\xff\xfe";
  EXPECT_TRUE(nlohmann::json::accept(ToJson(e)));
}

TEST(ReportJson, SeveralRunsHaveMeanAndSpread) {
  const std::vector<Evaluation> runs{Example(80, 0.3), Example(90, 0.5)};
  const nlohmann::json json = nlohmann::json::parse(ToJson(std::span(runs)));
  EXPECT_EQ(json["runs"].size(), 2u);
  EXPECT_EQ(json["mean"]["coverage"], 85.0);
  EXPECT_EQ(json["mean"]["live_coverage"], 80.0);
  EXPECT_EQ(json["spread"]["live_coverage"]["min"], 75.0);
  EXPECT_EQ(json["spread"]["coverage"]["min"], 80.0);
  EXPECT_NEAR(json["spread"]["rms_ate"]["deviation"].get<double>(), std::sqrt(0.02), 1e-12);
  EXPECT_TRUE(json["mean"]["visible_coverage"].is_null());
}

TEST(ReportText, SaysWhatMatters) {
  const std::string text = ToText(Example(80, 0.35));
  const std::size_t live = text.find("live coverage     75.00 %   (750 of 1000 frames");
  const std::size_t at_the_end = text.find("coverage          80.00 %   (800 of 1000 frames");
  ASSERT_NE(live, std::string::npos) << text;
  ASSERT_NE(at_the_end, std::string::npos) << text;
  EXPECT_LT(live, at_the_end);
  EXPECT_THAT(text, HasSubstr("1.00 % of its depth"));
  EXPECT_THAT(text, HasSubstr("0.3500 mm"));
  EXPECT_THAT(text, HasSubstr("FALSE relocalisation at frame 512: relative position is wrong"));
  EXPECT_THAT(text, HasSubstr("p99.9 39.0"));
  EXPECT_THAT(text, HasSubstr("#Obs/F"));
}

TEST(ReportText, RunWithoutMapsSaysSo) {
  Evaluation e;
  e.frames = 10;
  const std::string text = ToText(e);
  EXPECT_THAT(text, HasSubstr("no frame is localised in a map"));
  EXPECT_THAT(text, Not(HasSubstr("#Obs/F")));
}

TEST(ReportText, FramesWithoutAnAnswerAreSaid) {
  Evaluation e = Example(80, 0.35);
  EXPECT_THAT(ToText(e), Not(HasSubstr("without an answer")));
  e.unanswered_frames = 20;
  e.visible_frames = 500;
  e.live_visible_localised = 400;
  e.live_visible_coverage = 80.0;
  e.visible_localised = 450;
  e.visible_coverage = 90.0;
  EXPECT_THAT(ToText(e), HasSubstr("20 frames of the sequence without an answer"));
  EXPECT_THAT(ToText(e), HasSubstr("live visible      80.00 %   (400 of 500 frames"));
}

TEST(RunTable, LiveCoverageStandsBeforeThatAtTheEnd) {
  const std::vector<Evaluation> runs{Example(80, 0.3), Example(90, 0.5)};
  const std::string text = FormatTable(MakeRunTable(runs), TableFormat::kCsv);
  const std::size_t live = text.find("\nlive_coverage,80.00,7.07,75.00,85.00,75.00,85.00\n");
  ASSERT_NE(live, std::string::npos) << text;
  EXPECT_LT(live, text.find("\ncoverage,"));
  EXPECT_THAT(text, HasSubstr("\nlargest_map_rms_ate_percent_of_depth,1.14,"));
}

TEST(RunTable, ValuesThatARunDoesNotHaveAreLeftOutOfTheMean) {
  std::vector<Evaluation> runs{Example(80, 0.3), Example(90, 0.5), Example(70, 0.4)};
  runs[2].rms_ate.reset();
  for (const TableRow& row : MakeRunRows(runs)) {
    ASSERT_EQ(row.values.size(), 3u);
    if (row.metric == "rms_ate") {
      EXPECT_DOUBLE_EQ(row.spread->mean, 0.4);
      EXPECT_EQ(row.spread->count, 2u);
    }
    if (row.metric == "visible_coverage") {
      EXPECT_FALSE(row.spread.has_value());
    }
  }
}

TEST(RunTable, CsvHasAsManyFieldsInEveryLine) {
  std::vector<Evaluation> runs{Example(80, 0.3), Example(90, 0.5)};
  runs[1].name = "a,\"b\"";
  const std::string text = FormatTable(MakeRunTable(runs), TableFormat::kCsv);
  EXPECT_THAT(text, HasSubstr("metric,mean,std,min,max,losses,\"a,\"\"b\"\"\"\n"));
  EXPECT_THAT(text, HasSubstr("coverage,85.00,7.07,80.00,90.00,80.00,90.00\n"));
  EXPECT_THAT(text, HasSubstr("visible_coverage,,,,,,\n"));
}

TEST(RunTable, MarkdownIsATable) {
  const std::vector<Evaluation> runs{Example(80, 0.3), Example(90, 0.5)};
  std::istringstream lines(FormatTable(MakeRunTable(runs), TableFormat::kMarkdown));
  std::string line;
  std::size_t num_lines = 0;
  while (std::getline(lines, line)) {
    ++num_lines;
    if (num_lines <= 2) continue;  // heading
    EXPECT_EQ(std::count(line.begin(), line.end(), '|'), 8) << line;
    if (num_lines == 4) {
      EXPECT_THAT(line, HasSubstr("---:|"));
    }
  }
  EXPECT_EQ(num_lines, MakeRunRows(runs).size() + 4);
}

}  // namespace
}  // namespace haustra::evaluate
