#include "tools/report/report_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/tools/command/call_command.h"
#include "tests/tools/evaluate/run_folder.h"
#include "tests/tools/report/small_report.h"
#include "tools/evaluate/evaluate_command.h"
#include "tools/exit_codes.h"

namespace haustra::report {
namespace {

using ::testing::HasSubstr;

class ReportCommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    WriteRunFolder(folder_, "out", SmallRun());
    folder_.Write("out/times.csv", "frame_idx,stage,ms\n0,tracking/total,12.5\n1,tracking/total,20\n");
    folder_.Write("out/maps/map_0000/cameras.txt", "1 OPENCV_FISHEYE 720 540 398 398 360 270 0 0 0 0\n");
    folder_.Write("out/maps/map_0000/images.txt", "2 1 0 0 0 0 0 0 1 000006.jpg\n100.5 50.5 7 120.5 60.5 -1\n");
    folder_.Write("out/maps/map_0000/points3D.txt", "7 0.1 0.2 1.5 200 100 90 0.5 2 0\n");
    std::vector<StampedPose> truth;
    for (std::int64_t i = 0; i < 60; ++i) {
      truth.push_back({i * evaluate::kPeriodNs + 1000000000, evaluate::TruePose(i).Inverse()});
    }
    StringSink sink;
    ASSERT_TRUE(WriteTum(sink, truth, "millimetres").ok());
    folder_.Write("groundtruth.txt", sink.bytes());
  }

  // Exit code of one subcommand; what it prints on stderr is in err_.
  int Run(const std::vector<std::string>& arguments) {
    const CommandAnswer answer = CallCommand({AddReportCommand, AddEvaluateCommand}, arguments);
    err_ = answer.err;
    return answer.code;
  }
  std::string At(const std::string& name) const { return folder_.At(name); }

  evaluate::TextFolder folder_;
  std::string err_;
};

TEST_F(ReportCommandTest, PageHoldsTheFiguresThatEvaluateWrites) {
  ASSERT_EQ(Run({"evaluate", At("out"), "--groundtruth", At("groundtruth.txt"), "--json", At("e.json")}), kExitOk)
      << err_;
  ASSERT_EQ(Run({"report", At("out"), "--groundtruth", At("groundtruth.txt"), "--html", At("r.html")}), kExitOk)
      << err_;
  const nlohmann::json expected = nlohmann::json::parse(folder_.Read("e.json"));
  EXPECT_EQ(nlohmann::json::parse(ScriptText(folder_.Read("r.html"), "evaluation")), expected);
  EXPECT_EQ(expected["coverage"], 75.0);
  const nlohmann::json data = nlohmann::json::parse(ScriptText(folder_.Read("r.html"), "chart-data"));
  EXPECT_EQ(data["views"][0]["maps"][0]["points"].size(), 1u);
  EXPECT_EQ(data["times"][0]["samples"].size(), 2u);
}

TEST_F(ReportCommandTest, GroundTruthIsNotNeeded) {
  ASSERT_EQ(Run({"report", At("out"), "--html", At("r.html")}), kExitOk) << err_;
  EXPECT_THAT(folder_.Read("r.html"), HasSubstr("No ground truth was given"));
}

TEST_F(ReportCommandTest, OverwriteReplacesAnEarlierPageAndNoResultOfTheRun) {
  ASSERT_EQ(Run({"report", At("out"), "--html", At("out/report.html")}), kExitOk) << err_;
  EXPECT_EQ(Run({"report", At("out"), "--html", At("out/report.html")}), kExitInTheWay);
  EXPECT_THAT(err_, HasSubstr("report.html: exists already; --overwrite replaces it"));
  EXPECT_EQ(Run({"report", At("out"), "--html", At("out/report.html"), "--overwrite"}), kExitOk) << err_;
  const std::string frames = folder_.Read("out/frames.csv");
  EXPECT_EQ(Run({"report", At("out"), "--html", At("out/frames.csv"), "--overwrite"}), kExitInTheWay);
  EXPECT_THAT(err_, HasSubstr("out/frames.csv: exists already and is not a report of haustra"));
  EXPECT_EQ(folder_.Read("out/frames.csv"), frames);
}

TEST_F(ReportCommandTest, PageGoesBesideTheRunUnlessAnotherPlaceIsNamed) {
  ASSERT_EQ(Run({"report", At("out")}), kExitOk) << err_;
  const std::string page = folder_.Read("out/report.html");
  EXPECT_THAT(page, HasSubstr("No ground truth was given"));
  EXPECT_EQ(Run({"report", At("out"), "--groundtruth", At("groundtruth.txt")}), kExitInTheWay);
  EXPECT_THAT(err_, HasSubstr("out/report.html: exists already; --overwrite replaces it"));
  EXPECT_EQ(folder_.Read("out/report.html"), page);
  EXPECT_EQ(Run({"report", At("out"), "--groundtruth", At("groundtruth.txt"), "--overwrite"}), kExitOk) << err_;
  EXPECT_NE(folder_.Read("out/report.html"), page);
  EXPECT_EQ(Run({"report", At("none")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("none: no such folder"));
  EXPECT_EQ(Run({"report", At("out/frames.csv")}), kExitNoInput);
}

TEST_F(ReportCommandTest, RunWhoseMapsAreGoneHasNoReport) {
  std::filesystem::remove_all(At("out/maps"));
  EXPECT_EQ(Run({"report", At("out"), "--html", At("r.html")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("out/maps: no such folder"));
  EXPECT_FALSE(std::filesystem::exists(At("r.html")));
}

TEST_F(ReportCommandTest, ASurfaceGivesASectionOfItsOwn) {
  folder_.Write("wall/surface.json", R"({"maps": [{"map_id": 0, "lumen": {"found": false, "reason": "too short"}}]})");
  ASSERT_EQ(Run({"report", At("out"), "--surface", At("wall"), "--html", At("r.html")}), kExitOk) << err_;
  EXPECT_THAT(folder_.Read("r.html"), HasSubstr("No lumen was found: too short."));
  ASSERT_EQ(Run({"report", At("out"), "--html", At("plain.html")}), kExitOk) << err_;
  EXPECT_THAT(folder_.Read("plain.html"), ::testing::Not(HasSubstr("wall-section")));
}

TEST_F(ReportCommandTest, TheSurfaceOfTheRunIsTakenWithoutBeingAskedFor) {
  folder_.Write("out/surface/map_0000.ply", "ply\n");
  ASSERT_EQ(Run({"report", At("out"), "--html", At("half.html")}), kExitOk) << err_;
  EXPECT_THAT(folder_.Read("half.html"), ::testing::Not(HasSubstr("wall-section"))) << "it was not finished";
  folder_.Write("out/surface/surface.json", R"({"maps": [{"map_id": 0, "lumen": {"found": false, "reason": "own"}}]})");
  folder_.Write("wall/surface.json", R"({"maps": [{"map_id": 0, "lumen": {"found": false, "reason": "other"}}]})");
  ASSERT_EQ(Run({"report", At("out"), "--html", At("own.html")}), kExitOk) << err_;
  EXPECT_THAT(folder_.Read("own.html"), HasSubstr("No lumen was found: own."));
  ASSERT_EQ(Run({"report", At("out"), "--surface", At("wall"), "--html", At("other.html")}), kExitOk) << err_;
  EXPECT_THAT(folder_.Read("other.html"), HasSubstr("No lumen was found: other."));
}

TEST_F(ReportCommandTest, MissingInputsAreNamed) {
  EXPECT_EQ(Run({"report", At("none"), "--html", At("r.html")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("none: no such folder"));
  EXPECT_EQ(Run({"report", At("out"), "--groundtruth", At("none.txt"), "--html", At("r.html")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("none.txt"));
  EXPECT_EQ(Run({"report", At("out"), "--groundtruth", At("groundtruth.txt"), "--events", At("none.csv"), "--html",
                 At("r.html")}),
            kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("none.csv"));
  EXPECT_EQ(Run({"report", At("out"), "--sequence", At("none"), "--html", At("r.html")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("none: no such file or folder"));
  EXPECT_EQ(Run({"report", At("out"), "--surface", At("none"), "--html", At("r.html")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("surface.json"));
  folder_.Write("out/events.csv", "frame_idx,timestamp_ns,event,map_id,other_map_id,details\n");
  EXPECT_EQ(Run({"report", At("out"), "--sequence", At("none"), "--html", At("r.html")}), kExitNoInput) << "no joins";
  EXPECT_THAT(err_, HasSubstr("none: no such file or folder"));
  folder_.Remove("out/events.csv");
  EXPECT_EQ(Run({"report", At("out"), "--html", At("r.html")}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("events.csv"));
  EXPECT_EQ(folder_.Read("r.html"), "");
}

TEST_F(ReportCommandTest, DamagedModelIsNamedWithItsLine) {
  folder_.Write("out/maps/map_0000/images.txt", "# images\n2 1 0 0 0 0 0 0 1 000006.jpg\n100.5 50.5\n");
  EXPECT_EQ(Run({"report", At("out"), "--html", At("r.html")}), kExitBadData);
  EXPECT_THAT(err_, HasSubstr("images.txt:3: keypoints come in threes"));
}

TEST_F(ReportCommandTest, UsageAndWriteErrorsHaveTheirCodes) {
  EXPECT_EQ(Run({"report", "--html", At("r.html")}), kExitUsage);
  EXPECT_EQ(Run({"report", At("out"), "--html", At("r.html"), "--events", At("e.csv")}), kExitUsage);
  EXPECT_EQ(Run({"report", At("out"), "--html", At("no/such/r.html")}), kExitIo);
  EXPECT_THAT(err_, HasSubstr("r.html"));
}

}  // namespace
}  // namespace haustra::report
