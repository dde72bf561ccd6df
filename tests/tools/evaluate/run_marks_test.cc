#include "tools/evaluate/run_marks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/text_folder.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;

constexpr const char* kSummary = R"({"marks": {"set": [
  {"label": "<b>&\"x", "map_id": 2, "position": [0.5, -1, 2.25], "session": 1, "frame_idx": 30, "of_this_run": true},
  {"label": "old", "map_id": 0, "session": 0, "frame_idx": 7, "of_this_run": false}],
  "refused": [{"label": "late", "frame_idx": 99, "reason": "no such frame"}]}})";
constexpr const char* kTable =
    "frame_idx,mark,u_px,v_px,state,distance_in_depths\n"
    "31,<b>&\"x,10,20,in_front,1.5\n31,gone,1,2,in_front,1\n31,old,-1,-1,out_of_view,3\n";

class RunMarksTest : public ::testing::Test {
 protected:
  Result<RunMarks> Read(const std::string& summary, const std::string& table) const {
    folder_.Write("summary.json", summary);
    folder_.Write("marks.csv", table);
    return ReadRunMarks(folder_.At(""));
  }

  TextFolder folder_;
};

TEST_F(RunMarksTest, EverythingComesBack) {
  const Result<RunMarks> marks = Read(kSummary, kTable);
  ASSERT_TRUE(marks.ok()) << marks.status().message();
  ASSERT_EQ(marks->set.size(), 2u);
  EXPECT_EQ(marks->set[0].label, "<b>&\"x");
  EXPECT_EQ(marks->set[0].map_id, 2);
  EXPECT_EQ(marks->set[0].position, Eigen::Vector3d(0.5, -1.0, 2.25));
  EXPECT_EQ(marks->set[0].frame_idx, 30);
  EXPECT_FALSE(marks->set[1].position.has_value());
  EXPECT_FALSE(marks->set[1].is_of_this_run);
  ASSERT_EQ(marks->refused.size(), 1u);
  EXPECT_EQ(marks->refused[0].reason, "no such frame");
  ASSERT_EQ(marks->sightings.size(), 2u) << "one mark does not exist at the end";
  EXPECT_EQ(marks->sightings[0].mark, 0u);
  EXPECT_EQ(marks->sightings[0].state, "in_front");
  EXPECT_EQ(marks->sightings[0].distance_in_depths, 1.5);
  EXPECT_EQ(marks->sightings[1].mark, 1u);
  EXPECT_EQ(marks->sightings[1].frame_idx, 31);
}

TEST_F(RunMarksTest, ARunWithoutMarksHasNone) {
  folder_.Write("summary.json", "{}");
  const Result<RunMarks> marks = ReadRunMarks(folder_.At(""));
  ASSERT_TRUE(marks.ok()) << marks.status().message();
  EXPECT_TRUE(marks->set.empty());
}

TEST_F(RunMarksTest, WhatIsNotAsItShouldBeIsNamed) {
  EXPECT_THAT(Read(R"({"marks": {"set": [{"label": 7}]}})", kTable).status().message(),
              HasSubstr("summary.json: marks: "));
  EXPECT_THAT(Read(R"({"marks": []})", kTable).status().message(), HasSubstr("summary.json: marks: "));
  const Result<RunMarks> bad = Read(kSummary, "frame_idx,mark,state,distance_in_depths\nx,old,hidden,1\n");
  EXPECT_EQ(bad.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(bad.status().message(), HasSubstr("marks.csv:2: frame_idx is 'x'"));
  folder_.Remove("marks.csv");
  EXPECT_EQ(ReadRunMarks(folder_.At("")).code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace haustra::evaluate
