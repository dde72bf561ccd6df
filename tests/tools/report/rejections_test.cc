#include "tools/report/rejections.h"

#include <gtest/gtest.h>

#include "engine/place/common_area.h"
#include "engine/place/relocaliser.h"
#include "tests/tools/report/small_report.h"

namespace haustra::report {
namespace {

using Row = std::vector<std::string>;

TEST(FindRejections, TellsMergesLoopsAndRelocalisationsApart) {
  const std::vector<Rejection> rejections = FindRejections(SmallRun().events);
  ASSERT_EQ(rejections.size(), 4u);
  EXPECT_EQ(rejections[0].what, "merge");
  EXPECT_EQ(rejections[0].reason, "no_similarity");
  EXPECT_EQ(rejections[2].what, "loop");
  EXPECT_EQ(rejections[3].what, "relocalisation");
  EXPECT_EQ(rejections[3].frame_idx, 52);
}

TEST(MakeReasonTable, CountsTheMostFrequentFirst) {
  const evaluate::TextTable table = MakeReasonTable(FindRejections(SmallRun().events));
  ASSERT_EQ(table.rows.size(), 3u);
  EXPECT_EQ(table.rows[0][0], "no_similarity");
  EXPECT_EQ(Row(table.rows[0].begin() + 2, table.rows[0].end()), (Row{"2", "0", "0", "2"}));
  EXPECT_EQ(table.rows[1][0], "few_inliers");
  EXPECT_EQ(Row(table.rows[1].begin() + 2, table.rows[1].end()), (Row{"0", "0", "1", "1"}));
  EXPECT_EQ(Row(table.rows[2].begin() + 2, table.rows[2].end()), (Row{"0", "1", "0", "1"}));
}

TEST(MakeRejectionTable, HasTheCountsOfEachCandidate) {
  const evaluate::RunOutput run = SmallRun();
  const evaluate::TextTable table = MakeRejectionTable(FindRejections(run.events), run.frames, 100);
  ASSERT_EQ(table.rows.size(), 4u);
  // What, reason, frame, time from the first frame, maps, keyframe and its frame, votes, matches.
  EXPECT_EQ(Row(table.rows[1].begin(), table.rows[1].begin() + 10),
            (Row{"merge", "no_similarity", "35", "1.40", "1", "0", "3", "9", "21", "41"}));
  EXPECT_EQ(Row(table.rows[3].begin(), table.rows[3].begin() + 10),
            (Row{"relocalisation", "few_inliers", "52", "2.08", "0", "-", "4", "-", "9", "15"}));
  for (const Row& row : table.rows) EXPECT_EQ(row.size(), table.header.size());
}

TEST(MakeRejectionTable, IsCutAtTheLimit) {
  const evaluate::RunOutput run = SmallRun();
  EXPECT_EQ(MakeRejectionTable(FindRejections(run.events), run.frames, 3).rows.size(), 3u);
}

// A verdict that the engine learns must be explained here.
TEST(Explanation, KnowsEveryVerdictOfTheEngine) {
  for (int i = 1; ToString(static_cast<CommonAreaVerdict>(i)) != "unknown"; ++i) {
    const std::string_view reason = ToString(static_cast<CommonAreaVerdict>(i));
    EXPECT_FALSE(Explanation(reason).empty()) << reason;
  }
  for (int i = 1; ToString(static_cast<RelocalisationVerdict>(i)) != "unknown"; ++i) {
    const std::string_view reason = ToString(static_cast<RelocalisationVerdict>(i));
    EXPECT_FALSE(Explanation(reason).empty()) << reason;
  }
  EXPECT_TRUE(Explanation("accepted").empty());
}

}  // namespace
}  // namespace haustra::report
