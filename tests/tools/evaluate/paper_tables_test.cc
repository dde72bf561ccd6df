#include "tools/evaluate/paper_tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/tools/evaluate/synthetic_run.h"
#include "tools/evaluate/run_table.h"

namespace haustra::evaluate {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Row = std::vector<std::string>;

// A run that can be reckoned by hand. 100 frames, 40 ms apart: 50 in map 0, 25 in map 1, 25 in none.
//   map 0: 10 keyframes, 500 points, 50 frames with 100 points each: 2 s, 5 KF/s, 100 Obs/F, 5000 / 500 = 10 Obs(F)/MP
//   map 1:  4 keyframes, 100 points, 25 frames with  20 points each: 1 s, 4 KF/s,  20 Obs/F,  500 / 100 =  5 Obs(F)/MP
RunOutput SmallRun(const std::string& name, int more_keyframes = 0) {
  RunOutput run;
  run.folder = "results/" + name;
  for (std::int64_t i = 0; i < 100; ++i) {
    const int map_id = i < 50 ? 0 : i < 75 ? 1 : -1;
    SE3 believed = TruePose(i);
    believed.translation.z() += i % 2 == 0 ? 0.2 : -0.2;
    run.frames.push_back(MakeRunFrame(i, map_id, map_id, believed));
    run.frames.back().num_inliers = map_id == 0 ? 100 : 20;
  }
  run.maps = {{0, "stored", 10 + more_keyframes, 500}, {1, "active", 4, 100}};
  run.events = {Event(5, "map_created", 0), Event(52, "map_created", 1), Event(60, "relocalised", 1)};
  run.figures.realtime_ratio = 1.5;
  run.times = {{0, "mapping/bundle", 10.0}, {1, "mapping/bundle", 30.0}, {1, "place/total", 5.0}};
  return run;
}

Evaluation Evaluate(const RunOutput& run) { return EvaluateRun(run, TrueReference(100), {}); }

// Field of a row under a name of the header; `skip` earlier columns of that name.
std::string Field(const TextTable& table, std::size_t row, const std::string& name, int skip = 0) {
  for (std::size_t i = 0; i < table.header.size(); ++i) {
    if (table.header[i] == name && skip-- == 0) return table.rows.at(row).at(i);
  }
  return "no column " + name;
}

TEST(PaperTable, OneRunHasTheValuesReckonedByHand) {
  const Evaluation e = Evaluate(SmallRun("seed1"));
  const TextTable table = MakePaperTable(std::span(&e, 1));
  ASSERT_EQ(table.rows.size(), 1u);
  const Row row = table.rows[0];
  EXPECT_EQ(Row(row.begin(), row.begin() + 7), (Row{"seed1", "7.0", "300.0", "4.50", "1.50", "60.00", "7.50"}));
  EXPECT_EQ(Row(row.begin() + 7, row.begin() + 11), (Row{"10", "500", "5.00", "2.00"}));
  EXPECT_EQ(Row(row.begin() + 11, row.begin() + 14), (Row{"2", "0", "1"}));  // maps, merges, relocations
  EXPECT_NEAR(std::stod(row[14]), 0.2, 0.02);
  EXPECT_EQ(Row(row.begin() + 15, row.end()), (Row{"75.00", "75.00", "14", "600", "1.500"}));
  EXPECT_EQ(table.header[14], "RMS ATE mm");
  EXPECT_EQ(table.header[15], "live coverage %");
}

TEST(PaperTable, SeveralRunsHaveMeanAndStandardDeviation) {
  const std::vector<Evaluation> runs{Evaluate(SmallRun("seed1")), Evaluate(SmallRun("seed2", 4))};
  const TextTable table = MakePaperTable(runs);
  ASSERT_EQ(table.rows.size(), 4u);
  EXPECT_EQ(table.rows[2][0], "mean");
  EXPECT_EQ(table.rows[3][0], "std");
  // Mean over the maps: 7 and 9 keyframes; largest map: 10 and 14; global: 14 and 18.
  EXPECT_EQ(Field(table, 2, "#KF"), "8.0");
  EXPECT_EQ(Field(table, 3, "#KF"), "1.4");
  EXPECT_EQ(Field(table, 2, "#KF", 1), "12.0");
  EXPECT_EQ(Field(table, 3, "#KF", 1), "2.8");
  EXPECT_EQ(Field(table, 2, "#KF", 2), "16.0");
  EXPECT_EQ(Field(table, 2, "coverage %"), "75.00");
  EXPECT_EQ(Field(table, 3, "coverage %"), "0.00");
}

TEST(PaperTable, WhatARunDoesNotHaveIsADash) {
  RunOutput run = SmallRun("seed1");
  run.figures.realtime_ratio.reset();
  const Evaluation e = EvaluateRun(run, Reference(), {});
  const TextTable table = MakePaperTable(std::span(&e, 1));
  EXPECT_EQ(Field(table, 0, "RMS ATE units"), "-");
  EXPECT_EQ(Field(table, 0, "real-time ratio"), "-");
}

TEST(MapTable, HasEachMapBelowMeanAndLargest) {
  const TextTable table = MakeMapTable(Evaluate(SmallRun("seed1")));
  ASSERT_EQ(table.rows.size(), 4u);
  EXPECT_EQ(Field(table, 0, "#MP"), "300.0");
  EXPECT_EQ(Field(table, 1, "#MP"), "500.0");
  EXPECT_EQ(table.rows[3][0], "1");
  EXPECT_EQ(Field(table, 3, "#Obs(F)/MP"), "5.00");
  EXPECT_EQ(Field(table, 3, "frames"), "25");
}

TEST(StageTable, FiguresOfSeveralRunsAreMeansOfTheirs) {
  RunOutput other = SmallRun("seed2");
  for (StageTime& time : other.times) time.ms *= 3.0;
  const std::vector<Evaluation> runs{Evaluate(SmallRun("seed1")), Evaluate(other)};
  const TextTable one = MakeStageTable(std::span(runs).first(1)), both = MakeStageTable(runs);
  EXPECT_THAT(one.rows, ElementsAre(Row{"mapping/bundle", "2", "10.00", "30.00", "30.00", "20.00", "14.14"},
                                    Row{"place/total", "1", "5.00", "5.00", "5.00", "5.00", "0.00"}));
  EXPECT_EQ(both.rows[0], (Row{"mapping/bundle", "2.0", "20.00", "60.00", "60.00", "40.00", "28.28"}));
}

TEST(JoinTable, EveryJoinHasItsVerdictAndItsFigures) {
  Evaluation e = Evaluate(SmallRun("seed1"));
  JoinEvaluation merge;
  merge.frame_idx = 70;
  merge.map_id = 0;
  merge.other_map_id = 1;
  merge.verdict = Verdict::kFalse;
  merge.reason = "relative position is wrong";
  merge.ate_parts = 0.5;
  merge.ate_joined = 2.0;
  merge.duration_ms = 120.25;
  e.joins = {merge};
  const TextTable table = MakeJoinTable(std::span(&e, 1));
  ASSERT_EQ(table.rows.size(), 1u);
  EXPECT_EQ(Field(table, 0, "verdict"), "false");
  EXPECT_EQ(Field(table, 0, "why"), "relative position is wrong");
  EXPECT_EQ(Field(table, 0, "maps"), "0 and 1");
  EXPECT_EQ(Field(table, 0, "ATE joined mm"), "2.0000");
  EXPECT_EQ(Field(table, 0, "joined / parts"), "4.00");
  EXPECT_EQ(Field(table, 0, "joined / depth"), "-");
  EXPECT_EQ(Field(table, 0, "duration ms"), "120.2");
}

TEST(PrecisionTable, CountsAndShares) {
  Evaluation e = Evaluate(SmallRun("seed1"));
  e.merges = {5, 4, 1};
  e.merge_recall = Recall{8, 6};
  const TextTable table = MakePrecisionTable(std::span(&e, 1));
  EXPECT_EQ(table.rows[0], (Row{"seed1", "merges", "5", "4", "1", "75.0", "8", "6", "75.0"}));
  EXPECT_EQ(Field(table, 1, "precision %"), "-");
}

TEST(RunRows, PapersValuesAndStagesAreAmongThem) {
  const std::vector<Evaluation> runs{Evaluate(SmallRun("seed1"))};
  std::map<std::string, std::optional<double>> values;
  for (const TableRow& row : MakeRunRows(runs)) values[row.metric] = row.values[0];
  EXPECT_EQ(values.at("mean_map.keyframes"), 7.0);
  EXPECT_EQ(values.at("mean_map.observations_per_point"), 7.5);
  EXPECT_EQ(values.at("largest_map.life_time_s"), 2.0);
  EXPECT_EQ(values.at("keyframes"), 14.0);
  EXPECT_EQ(values.at("stages.mapping/bundle.mean"), 20.0);
  EXPECT_EQ(values.at("stages.place/total.count"), 1.0);
}

TextTable Example() {
  TextTable table;
  table.title = "A title";
  table.groups = {{"", 1}, {"both", 2}};
  table.header = {"name", "a", "b"};
  table.rows = {{"x,y", "1.0", "-"}, {"p|q", "10.0", "3"}};
  return table;
}

TEST(TextTable, TextIsAlignedUnderItsGroups) {
  EXPECT_EQ(FormatTable(Example(), TableFormat::kText),
            "         both\n"
            "name     a  b\n"
            "x,y    1.0  -\n"
            "p|q   10.0  3\n");
}

TEST(TextTable, CsvQuotesCommasAndLeavesNothingBlank) {
  EXPECT_EQ(FormatTable(Example(), TableFormat::kCsv), "name,both a,both b\n\"x,y\",1.0,\np|q,10.0,3\n");
}

TEST(TextTable, MarkdownEscapesItsSeparator) {
  const std::string text = FormatTable(Example(), TableFormat::kMarkdown);
  EXPECT_THAT(text, HasSubstr("## A title\n\n| name | both a | both b |\n|------|-------:|-------:|\n"));
  EXPECT_THAT(text, HasSubstr("| p\\|q |"));
}

TEST(TextTable, LettersOfSeveralBytesDoNotBreakTheColumns) {
  TextTable table;
  table.header = {"name", "v"};
  table.rows = {{"Größe", "1"}, {"abcde", "2"}};
  EXPECT_EQ(FormatTable(table, TableFormat::kText), "name   v\nGröße  1\nabcde  2\n");
}

}  // namespace
}  // namespace haustra::evaluate
