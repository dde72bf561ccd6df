#include "tools/evaluate/reference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/text_folder.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;

constexpr char kPoses[] =
    "# timestamp tx ty tz qx qy qz qw (millimetres)\n"
    "0.000000 1 2 3 0 0 0 1\n0.040000 1 2 4 0 0 0 1\n";

class ReferenceTest : public ::testing::Test {
 protected:
  TextFolder folder_;
};

TEST_F(ReferenceTest, PosesAndUnitAreRead) {
  const Result<Reference> reference = ReadReference(folder_.Write("groundtruth.txt", kPoses), "");
  ASSERT_TRUE(reference.ok()) << reference.status().ToString();
  EXPECT_EQ(reference->poses.size(), 2u);
  EXPECT_EQ(reference->poses[1].timestamp_ns, 40000000);
  EXPECT_EQ(reference->unit, "mm");
  EXPECT_FALSE(reference->events.has_value());
}

TEST_F(ReferenceTest, UnitIsNotGuessedFromOtherWords) {
  const std::string path = folder_.Write("gt.txt", "# comment: summary of commands\n0 1 2 3 0 0 0 1\n");
  EXPECT_EQ(ReadReference(path, "")->unit, "units");
}

TEST_F(ReferenceTest, EventsBesideTheGroundTruthAreTakenUp) {
  folder_.Write("events.csv", "first_frame,last_frame,kind,visible\n5,9,redout,0\n20,25,nbi,1\n");
  const Result<Reference> reference = ReadReference(folder_.Write("groundtruth.txt", kPoses), "");
  ASSERT_TRUE(reference.ok()) << reference.status().ToString();
  ASSERT_TRUE(reference->events.has_value());
  ASSERT_EQ(reference->events->size(), 2u);
  EXPECT_EQ((*reference->events)[0].last_frame, 9);
  EXPECT_EQ((*reference->events)[0].kind, "redout");
  EXPECT_FALSE((*reference->events)[0].is_visible);
  EXPECT_TRUE((*reference->events)[1].is_visible);
}

TEST_F(ReferenceTest, HeaderWithoutEventsMeansThatAllCanBeSeen) {
  folder_.Write("events.csv", "first_frame,last_frame,kind,visible\n");
  const Result<Reference> reference = ReadReference(folder_.Write("groundtruth.txt", kPoses), "");
  ASSERT_TRUE(reference.ok());
  EXPECT_TRUE(reference->events.has_value());
}

TEST_F(ReferenceTest, OtherTableOfThatNameIsIgnoredUnlessItWasNamed) {
  const std::string events = folder_.Write("events.csv", "frame_idx,timestamp_ns,event\n1,2,lost\n");
  const std::string poses = folder_.Write("groundtruth.txt", kPoses);
  EXPECT_FALSE(ReadReference(poses, "")->events.has_value());
  EXPECT_THAT(ReadReference(poses, events).status().message(), HasSubstr("no column 'first_frame'"));
}

TEST_F(ReferenceTest, NamedEventsThatAreMissingAreAnError) {
  const std::string poses = folder_.Write("groundtruth.txt", kPoses);
  EXPECT_EQ(ReadReference(poses, folder_.At("other.csv")).code(), StatusCode::kNotFound);
}

TEST_F(ReferenceTest, MalformedEventsAreNamedWithTheirLine) {
  const std::string poses = folder_.Write("groundtruth.txt", kPoses);
  const auto message = [&](const std::string& row) {
    folder_.Write("events.csv", "first_frame,last_frame,kind,visible\n" + row + "\n");
    return ReadReference(poses, "").status().message();
  };
  EXPECT_THAT(message("9,5,redout,0"), HasSubstr("events.csv:2: frames 9 to 5 are no range"));
  EXPECT_THAT(message("-1,5,redout,0"), HasSubstr("frames -1 to 5"));
  EXPECT_THAT(message("1,5,redout,2"), HasSubstr("visible is 2, not 0 or 1"));
  EXPECT_THAT(message("1,x,redout,0"), HasSubstr("last_frame is 'x'"));
}

TEST_F(ReferenceTest, TimesBesideTheEventsAreRead) {
  folder_.Write("events.csv", "first_frame,last_frame,kind,visible\n");
  folder_.Write("times.txt", "0.0\n0.04\n0.08\n");
  const std::string poses = folder_.Write("groundtruth.txt", kPoses);
  EXPECT_EQ(ReadReference(poses, "")->frame_stamps_ns, (std::vector<std::int64_t>{0, 40000000, 80000000}));
  folder_.Write("times.txt", "0.0\n0.04\n0.04\n");
  EXPECT_THAT(ReadReference(poses, "").status().message(), HasSubstr("times.txt:3:"));
  folder_.Write("times.txt", "0.0\nsoon\n");
  EXPECT_THAT(ReadReference(poses, "").status().message(), HasSubstr("times.txt:2: 'soon'"));
}

TEST_F(ReferenceTest, MissingOrMalformedGroundTruthIsNamed) {
  EXPECT_EQ(ReadReference(folder_.At("none.txt"), "").code(), StatusCode::kNotFound);
  const Result<Reference> bad = ReadReference(folder_.Write("gt.txt", "0 1 2 3 0 0 0 1\n0.04 1 2 x 0 0 0 1\n"), "");
  EXPECT_EQ(bad.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(bad.status().message(), HasSubstr("gt.txt:2:"));
}

TEST(FramePeriod, IsTheMedianGapAndForgivesMissingFrames) {
  std::vector<RunFrame> frames(6);
  const std::int64_t stamps[] = {0, 40, 80, 200, 240, 280};
  for (int i = 0; i < 6; ++i) frames[i].timestamp_ns = stamps[i];
  EXPECT_EQ(FramePeriodNs(frames), 40);
  EXPECT_EQ(FramePeriodNs({}), 0);
  EXPECT_EQ(FramePeriodNs({frames[0]}), 0);
}

}  // namespace
}  // namespace haustra::evaluate
