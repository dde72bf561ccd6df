#include "tools/evaluate/evaluate_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/tools/command/call_command.h"
#include "tests/tools/evaluate/run_folder.h"
#include "tools/exit_codes.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;

class EvaluateCommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    RunOutput run;
    for (std::int64_t i = 0; i < 100; ++i) {
      const int map_id = i < 20 ? -1 : 1;
      SE3 believed = TruePose(i);
      believed.translation.z() += i % 2 == 0 ? 0.3 : -0.3;
      run.frames.push_back(MakeRunFrame(i, map_id, map_id, believed));
    }
    run.maps = {{1, "active", 12, 900}};
    WriteRunFolder(folder_, "out", run);
    WriteRunFolder(folder_, "second", run);

    std::vector<StampedPose> truth;
    for (std::int64_t i = 0; i < 100; ++i) truth.push_back({i * kPeriodNs, TruePose(i).Inverse()});
    StringSink sink;
    ASSERT_TRUE(WriteTum(sink, truth, "millimetres").ok());
    folder_.Write("colon/groundtruth.txt", sink.bytes());
    folder_.Write("colon/events.csv", "first_frame,last_frame,kind,visible\n0,9,redout,0\n");
  }

  // Exit code of `haustra evaluate ...`; what it prints is in out_ and err_.
  int Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "evaluate");
    const CommandAnswer answer = CallCommand({AddEvaluateCommand}, arguments);
    out_ = answer.out;
    err_ = answer.err;
    return answer.code;
  }
  std::string Truth() const { return folder_.At("colon/groundtruth.txt"); }

  TextFolder folder_;
  std::string out_, err_;
};

TEST_F(EvaluateCommandTest, OneRunIsPrintedAndWritten) {
  ASSERT_EQ(Run({folder_.At("out"), "--groundtruth", Truth(), "--json", folder_.At("e.json")}), kExitOk) << err_;
  EXPECT_THAT(out_, HasSubstr("80.00 %"));
  EXPECT_THAT(out_, HasSubstr(" mm "));
  const nlohmann::json json = nlohmann::json::parse(folder_.Read("e.json"));
  EXPECT_EQ(json["frames"], 100);
  EXPECT_EQ(json["localised"], 80);
  EXPECT_NEAR(json["rms_ate"].get<double>(), 0.3, 0.02);
  EXPECT_EQ(json["live_coverage"], 80.0);
  EXPECT_NEAR(json["live_visible_coverage"].get<double>(), 100.0 * 80 / 90, 1e-9);
  EXPECT_NEAR(json["visible_coverage"].get<double>(), 100.0 * 80 / 90, 1e-9);
  EXPECT_EQ(json["frame_ms"]["p50"], 21.5);
}

TEST_F(EvaluateCommandTest, OverwriteReplacesEarlierFiguresAndNoResultOfTheRun) {
  for (const std::vector<std::string>& runs :
       {std::vector{folder_.At("out")}, {folder_.At("out"), folder_.At("second")}}) {
    for (const auto& [option, name] : {std::pair("--json", "e.json"), {"--table", "t.csv"}, {"--table", "t.md"}}) {
      std::vector<std::string> arguments = runs;
      arguments.insert(arguments.end(), {option, folder_.At(name), "--overwrite"});
      EXPECT_EQ(Run(arguments), kExitOk) << err_;
      EXPECT_EQ(Run(arguments), kExitOk) << err_;
    }
  }
  for (const auto& [option, name] : {std::pair("--json", "out/summary.json"), {"--table", "out/frames.csv"}}) {
    const std::string before = folder_.Read(name);
    EXPECT_EQ(Run({folder_.At("out"), option, folder_.At(name), "--overwrite"}), kExitInTheWay);
    EXPECT_THAT(err_, HasSubstr(std::string(name) + ": exists already and is not a "));
    EXPECT_EQ(folder_.Read(name), before);
  }
}

TEST_F(EvaluateCommandTest, SameInputGivesTheSameBytes) {
  ASSERT_EQ(Run({folder_.At("out"), "--groundtruth", Truth(), "--json", folder_.At("a.json")}), kExitOk);
  ASSERT_EQ(Run({folder_.At("out"), "--groundtruth", Truth(), "--json", folder_.At("b.json")}), kExitOk);
  EXPECT_EQ(folder_.Read("a.json"), folder_.Read("b.json"));
}

TEST_F(EvaluateCommandTest, SeveralRunsGiveATable) {
  for (const char* table : {"t.csv", "t.md"}) {
    ASSERT_EQ(Run({folder_.At("out"), folder_.At("second"), "--groundtruth", Truth(), "--table", folder_.At(table),
                   "--json", folder_.At("e.json"), "--overwrite"}),
              kExitOk)
        << err_;
    EXPECT_THAT(folder_.Read(table), HasSubstr("visible_coverage"));
  }
  EXPECT_THAT(out_, HasSubstr("metric"));
  EXPECT_EQ(nlohmann::json::parse(folder_.Read("e.json"))["runs"].size(), 2u);
}

TEST_F(EvaluateCommandTest, NamedEventsReplaceTheOnesBesideTheGroundTruth) {
  const std::string events = folder_.Write("other.csv", "first_frame,last_frame,kind,visible\n0,19,redout,0\n");
  ASSERT_EQ(Run({folder_.At("out"), "--groundtruth", Truth(), "--events", events}), kExitOk) << err_;
  EXPECT_THAT(out_, HasSubstr("80 of 80 frames"));
}

TEST_F(EvaluateCommandTest, GroundTruthIsNotNeededForCoverage) {
  ASSERT_EQ(Run({folder_.At("out"), "--json", folder_.At("e.json")}), kExitOk) << err_;
  nlohmann::json json = nlohmann::json::parse(folder_.Read("e.json"));
  EXPECT_EQ(json["live_coverage"], 80.0);
  EXPECT_TRUE(json["rms_ate"].is_null());
  EXPECT_TRUE(json["visible_coverage"].is_null());
  ASSERT_EQ(Run({folder_.At("out"), "--events", folder_.At("colon/events.csv"), "--json", folder_.At("e.json"),
                 "--overwrite"}),
            kExitOk)
      << err_;
  json = nlohmann::json::parse(folder_.Read("e.json"));
  EXPECT_NEAR(json["live_visible_coverage"].get<double>(), 100.0 * 80 / 90, 1e-9);
}

TEST_F(EvaluateCommandTest, OfARunWithoutAMapThereIsNoErrorAndItSaysWhy) {
  RunOutput run;
  for (std::int64_t i = 0; i < 100; ++i) run.frames.push_back(MakeRunFrame(i, -1, -1, TruePose(i)));
  WriteRunFolder(folder_, "dark", run);
  ASSERT_EQ(Run({folder_.At("dark"), "--groundtruth", Truth(), "--json", folder_.At("e.json")}), kExitOk) << err_;
  EXPECT_THAT(out_, HasSubstr("coverage          0.00 %   (0 of 100 frames"));
  EXPECT_THAT(out_, HasSubstr("RMS ATE           -   (no frame is localised in a map)"));
  EXPECT_THAT(out_, HasSubstr("warning: recall is not known: no frame is localised in a map\n"));
  const nlohmann::json json = nlohmann::json::parse(folder_.Read("e.json"));
  EXPECT_EQ(json["coverage"], 0.0);
  EXPECT_TRUE(json["rms_ate"].is_null());
  EXPECT_TRUE(json["scene_depth"].is_null());
  EXPECT_TRUE(json["per_map"].empty());
}

TEST_F(EvaluateCommandTest, FilesThatAreThereAreKept) {
  const std::string earlier = "{\n  \"run\": \"earlier\"\n}\n";
  const std::string json = folder_.Write("e.json", earlier);
  EXPECT_EQ(Run({folder_.At("out"), "--json", json}), kExitInTheWay);
  EXPECT_THAT(err_, HasSubstr("e.json: exists already; --overwrite replaces it"));
  EXPECT_EQ(folder_.Read("e.json"), earlier);
}

TEST_F(EvaluateCommandTest, ExitCodesTellWhatWasWrong) {
  EXPECT_EQ(Run({}), kExitUsage);
  EXPECT_EQ(Run({"--groundtruth", Truth()}), kExitUsage);
  EXPECT_EQ(Run({folder_.At("out"), "--groundtruth", Truth(), "--table", "t.pdf"}), kExitUsage);
  EXPECT_EQ(Run({folder_.At("none"), "--groundtruth", Truth()}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("none: no such folder"));
  EXPECT_EQ(Run({folder_.At("out"), "--groundtruth", folder_.At("none.txt")}), kExitNoInput);
  const std::string bad = folder_.Write("bad.txt", "0 1 2 3\n");
  EXPECT_EQ(Run({folder_.At("out"), "--groundtruth", bad}), kExitBadData);
  EXPECT_THAT(err_, HasSubstr("bad.txt:1:"));
  EXPECT_EQ(Run({folder_.At("out"), "--groundtruth", Truth(), "--json", folder_.At("no/such/e.json")}), kExitIo);
  EXPECT_THAT(err_, HasSubstr("e.json"));
}

}  // namespace
}  // namespace haustra::evaluate
