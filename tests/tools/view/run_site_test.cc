#include "tools/view/run_site.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/tools/command/call_command.h"
#include "tests/tools/evaluate/run_folder.h"
#include "tests/tools/report/small_report.h"
#include "tools/report/base64.h"
#include "tools/view/column.h"
#include "tools/view/view_command.h"

namespace haustra::view {
namespace {

using ::testing::HasSubstr;

class RunSiteTest : public ::testing::Test {
 protected:
  void SetUp() override {
    WriteRunFolder(folder_, "out", report::SmallRun());
    folder_.Write("out/times.csv", "frame_idx,stage,ms\n0,tracking/total,12.5\n1,tracking/total,20\n");
    folder_.Write("out/maps/map_0000/cameras.txt", "1 OPENCV_FISHEYE 720 540 398 398 360 270 0 0 0 0\n");
    folder_.Write("out/maps/map_0000/images.txt", "2 1 0 0 0 0 0 0 1 000006.jpg\n100.5 50.5 7 120.5 60.5 -1\n");
    folder_.Write("out/maps/map_0000/points3D.txt", "7 0.25 0.5 1.5 200 100 90 0.5 2 0\n");
  }
  Result<ViewSite> Make(const std::string& surface = "") const {
    return MakeRunSite({folder_.At("out"), surface.empty() ? surface : folder_.At(surface)});
  }
  static nlohmann::json DataOf(const ViewSite& site) {
    return nlohmann::json::parse(site.resources.at("run.json").bytes);
  }

  evaluate::TextFolder folder_;
};

TEST_F(RunSiteTest, HoldsThePageAndEverythingThatItNames) {
  const Result<ViewSite> site = Make();
  ASSERT_TRUE(site.ok()) << site.status().message();
  const std::string& page = site->resources.at("").bytes;
  for (const char* name : {"three.js", "chart.js", "scene_3d.js", "panels.js", "run.js"}) {
    EXPECT_THAT(page, HasSubstr(std::string("<script src=\"") + name + "\">"));
    EXPECT_FALSE(site->resources.at(name).bytes.empty()) << name;
  }
  EXPECT_THAT(page, HasSubstr("three.js authors"));
  EXPECT_THAT(site->resources.at("three.js").bytes, HasSubstr("PLYLoader"));
  EXPECT_THAT(page, ::testing::Not(HasSubstr("http://")));
  EXPECT_FALSE(site->open_stream);
}

TEST_F(RunSiteTest, DataAreThoseOfTheRun) {
  const Result<ViewSite> site = Make();
  ASSERT_TRUE(site.ok()) << site.status().message();
  const nlohmann::json data = DataOf(*site);
  EXPECT_EQ(data["mode"], "sequential");
  EXPECT_EQ(data["period_ms"], 40.0);
  ASSERT_EQ(data["maps"].size(), 1u);
  EXPECT_EQ(data["maps"][0]["points"], Column(std::vector<float>{0.25f, 0.5f, 1.5f}));
  EXPECT_EQ(data["maps"][0]["rgb"], Column(std::vector<std::uint8_t>{200, 100, 90}));
  EXPECT_TRUE(data["maps"][0]["surface"].is_null());
  // 60 frames: position and orientation in single precision.
  const auto base64_length = [](std::size_t num_bytes) { return (num_bytes + 2) / 3 * 4; };
  EXPECT_EQ(data["frames"]["position"].get<std::string>().size(), base64_length(60 * 3 * sizeof(float)));
  EXPECT_EQ(data["frames"]["orientation"].get<std::string>().size(), base64_length(60 * 4 * sizeof(float)));
  EXPECT_EQ(data["frames"]["state"].get<std::string>().size(), base64_length(60));
  // What was rejected is the report's business.
  for (const nlohmann::json& event : data["events"]) EXPECT_NE(event["event"], "merge_rejected");
  EXPECT_EQ(data["events"][0]["event"], "map_created");
}

TEST_F(RunSiteTest, EventsThatAreNotShownAreCounted) {
  EXPECT_EQ(DataOf(*Make())["num_events"], DataOf(*Make())["events"].size());
  evaluate::RunOutput run = report::SmallRun();
  for (int i = 0; i < 2500; ++i) run.events.push_back(evaluate::Event(59, "lost", 0));
  WriteRunFolder(folder_, "out", run);
  const nlohmann::json data = DataOf(*Make());
  EXPECT_EQ(data["events"].size(), 2000u);
  EXPECT_EQ(data["num_events"], 2504);
}

TEST_F(RunSiteTest, MarksHaveAPlaceAndAStateInEachFrame) {
  EXPECT_TRUE(DataOf(*Make())["marks"].empty());
  evaluate::RunOutput run = report::SmallRun();
  run.marks = report::SmallMarks();
  WriteRunFolder(folder_, "out", run);
  const Result<ViewSite> site = Make();
  ASSERT_TRUE(site.ok()) << site.status().message();
  const nlohmann::json data = DataOf(*site);
  EXPECT_EQ(data["mark_states"], nlohmann::json({"in_front", "out_of_view", "unsure", "hidden"}));
  ASSERT_EQ(data["marks"].size(), 2u);
  const nlohmann::json& mark = data["marks"][0];
  EXPECT_EQ(mark["label"], "<b>&\"x");
  EXPECT_EQ(mark["map"], 0);
  EXPECT_EQ(mark["frame"], 8);
  EXPECT_EQ(mark["position"], nlohmann::json({0.25, 0.5, 1.5}));
  std::vector<std::uint8_t> states(60, 255);
  states[9] = 0, states[10] = 2, states[11] = states[12] = 3, states[56] = 0;
  EXPECT_EQ(mark["state"], Column(states));
  std::vector<float> distances(60, 0.0f);
  distances[9] = 1.5f, distances[10] = 1.25f, distances[11] = 1.0f, distances[12] = 0.75f, distances[56] = 2.5f;
  EXPECT_EQ(mark["distance"], Column(distances));
  EXPECT_EQ(data["marks"][1]["frame"], -1) << "of an earlier run";
  EXPECT_TRUE(data["marks"][1]["position"].is_null()) << "an older run does not say it";
}

TEST_F(RunSiteTest, ASurfaceIsFoundBesideTheRunOrWhereItIsSaid) {
  folder_.Write("out/surface/map_0000.ply", "ply\nformat ascii 1.0\nend_header\n");
  folder_.Write("out/surface/surface.json", R"({"maps":[]})");
  folder_.Write("mesh/map_0000.ply", "ply\nformat ascii 1.0\ncomment other\nend_header\n");
  folder_.Write("mesh/surface.json", R"({"maps":[]})");
  EXPECT_EQ(DataOf(*Make())["maps"][0]["surface"], "map_0000.ply");
  const Result<ViewSite> other = Make("mesh");
  ASSERT_TRUE(other.ok());
  EXPECT_THAT(other->resources.at("map_0000.ply").bytes, HasSubstr("comment other"));
}

// surface.json is written last: without it the making of the surface was broken off.
TEST_F(RunSiteTest, HalfASurfaceIsNotShown) {
  folder_.Write("out/surface/map_0000.ply", "ply\nend_header\n");
  const Result<ViewSite> site = Make();
  ASSERT_TRUE(site.ok()) << site.status().message();
  EXPECT_TRUE(DataOf(*site)["maps"][0]["surface"].is_null());
  EXPECT_FALSE(site->resources.contains("map_0000.ply"));
  EXPECT_EQ(Make("out/surface").code(), StatusCode::kNotFound);
}

TEST_F(RunSiteTest, WhatWasLookedAtComesWithTheSurface) {
  folder_.Write("out/surface/map_0000.ply", "ply\nend_header\n");
  folder_.Write("out/surface/surface.json", R"({"maps":[]})");
  EXPECT_TRUE(DataOf(*Make())["maps"][0]["wall"].is_null()) << "of before there was a coverage";
  folder_.Write("out/surface/surface.json",
                R"({"maps":[{"map_id":0,"lumen":{"found":true},"wall_coverage":0.75},{"map_id":7,"lumen":{}}]})");
  EXPECT_TRUE(DataOf(*Make())["maps"][0]["wall"]["picture"].is_null());
  folder_.Write("out/surface/map_0000_wall.png", "a picture");
  const Result<ViewSite> site = Make();
  ASSERT_TRUE(site.ok()) << site.status().message();
  const nlohmann::json wall = DataOf(*site)["maps"][0]["wall"];
  EXPECT_EQ(wall["map"], 0);
  EXPECT_EQ(wall["wall_coverage"], 0.75);
  EXPECT_EQ(site->resources.at(wall["picture"].get<std::string>()).bytes, "a picture");
  for (const char* text : {"[]", "{\"maps\":3}", "not JSON"}) {
    folder_.Write("out/surface/surface.json", text);
    EXPECT_EQ(Make().code(), StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(Make().status().message(), HasSubstr("surface.json"));
  }
}

TEST_F(RunSiteTest, ASurfaceOfAnotherRunIsRefused) {
  const auto checksum = [&] {
    const auto model = report::ReadMapModel(folder_.At("out/maps/map_0000"));
    EXPECT_TRUE(model.ok());
    return report::ChecksumOfPoses(*model);
  };
  const std::string of_this_run = checksum();
  folder_.Write("mesh/map_0000.ply", "ply\nend_header\n");
  folder_.Write("mesh/surface.json", R"({"maps":[{"map_id":0,"poses_checksum":")" + of_this_run + R"("}]})");
  EXPECT_TRUE(Make("mesh").ok());
  folder_.Write("out/maps/map_0000/images.txt", "2 1 0 0 0 0 0 1.0001 1 000006.jpg\n100.5 50.5 7 120.5 60.5 -1\n");
  EXPECT_NE(checksum(), of_this_run);
  EXPECT_EQ(Make("mesh").code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(Make("mesh").status().message(), HasSubstr("map_0000.ply: made of the map of another run"));
}

TEST_F(RunSiteTest, ASurfaceThatIsNotThereOrIsNoneIsNamed) {
  EXPECT_EQ(Make("none").code(), StatusCode::kNotFound);
  EXPECT_THAT(Make("none").status().message(), HasSubstr("none: no such folder"));
  folder_.Write("mesh/map_0007.ply", "ply\n");
  EXPECT_EQ(Make("mesh").code(), StatusCode::kNotFound);
  EXPECT_THAT(Make("mesh").status().message(), HasSubstr("no whole surface of a map of this run"));
  folder_.Write("mesh/surface.json", R"({"maps":[]})");
  folder_.Write("mesh/map_0000.ply", "solid");
  EXPECT_EQ(Make("mesh").code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(Make("mesh").status().message(), HasSubstr("map_0000.ply: not a PLY file"));
}

TEST_F(RunSiteTest, WhatIsMissingOrDamagedIsNamed) {
  EXPECT_EQ(MakeRunSite({folder_.At("none"), ""}).code(), StatusCode::kNotFound);
  folder_.Write("out/maps/map_0000/points3D.txt", "7 0.25 0.5\n");
  EXPECT_THAT(Make().status().message(), HasSubstr("points3D.txt:1: not a point"));
  folder_.Write("out/frames.csv", "frame_idx\nx\n");
  EXPECT_EQ(Make().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(Make().status().message(), HasSubstr("frames.csv"));
  folder_.Remove("out/events.csv");
  WriteRunFolder(folder_, "out", report::SmallRun());
  folder_.Remove("out/events.csv");
  EXPECT_EQ(Make().code(), StatusCode::kNotFound);
  EXPECT_THAT(Make().status().message(), HasSubstr("events.csv"));
}

TEST_F(RunSiteTest, TheCommandRefusesBeforeItServes) {
  const auto view = [&](const std::vector<std::string>& arguments) { return CallCommand({AddViewCommand}, arguments); };
  const CommandAnswer none = view({"view", folder_.At("none")});
  EXPECT_EQ(none.code, kExitNoInput);
  EXPECT_THAT(none.err, HasSubstr("haustra view: "));
  EXPECT_THAT(none.err, HasSubstr("none: no such folder"));
  EXPECT_EQ(view({"view", folder_.At("out"), "--port", "70000"}).code, kExitUsage);
  EXPECT_EQ(view({"view", folder_.At("out"), "--token-file", folder_.At("none")}).code, kExitNoInput);
}

}  // namespace
}  // namespace haustra::view
