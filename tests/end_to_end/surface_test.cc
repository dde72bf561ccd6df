// The surface of a rendered colon, against the depth that the renderer knows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

using ::testing::HasSubstr;

std::vector<std::string> SurfaceArguments(const std::string& out) {
  return {"surface", ResultFolder("depth"), "--sequence", SequenceFolder("depth"), "--out", out};
}

TEST(Surface, DepthIsNearTheTruthAndTheMeshIsTheSameOnAnyNumberOfThreads) {
  const std::string scratch = ScratchFolder();
  std::vector<std::string> arguments = SurfaceArguments(scratch + "/a");
  arguments.insert(arguments.end(),
                   {"--groundtruth", SequenceFolder("depth") + "/groundtruth.txt", "--depth-maps", "--threads", "2"});
  const CommandResult judged = Haustra(arguments);
  ASSERT_EQ(judged.exit_code, 0) << judged.ToString();
  EXPECT_THAT(judged.out, HasSubstr("median error"));
  const nlohmann::json json = ReadJson(scratch + "/a/surface.json");
  const nlohmann::json& depth = json["depth"];
  // When this was written: 7 keyframes, 87.1 %, 2.8 %, 92.5 %, 2.3 mm, 13866 triangles.
  EXPECT_GT(depth["keyframes"], 3);
  EXPECT_GT(depth["completeness"], 0.8) << depth.dump();
  EXPECT_LT(depth["median_error"], 0.04) << depth.dump();
  EXPECT_GT(depth["within_10_percent"], 0.85) << depth.dump();
  EXPECT_LT(depth["rms_mm"], 3.0) << depth.dump();
  EXPECT_GT(json["maps"][0]["triangles"], 10000);
  EXPECT_EQ(json["maps"][0]["refused_blocks"], 0);

  std::vector<std::string> again = SurfaceArguments(scratch + "/b");
  again.insert(again.end(), {"--threads", "1"});
  ASSERT_EQ(Haustra(again).exit_code, 0);
  for (const char* name : {"/map_0000.ply", "/map_0000.glb"}) {
    EXPECT_EQ(ReadBytes(scratch + "/a" + name), ReadBytes(scratch + "/b" + name)) << name;
  }
  // Without the truth nothing is judged; depth maps are written when asked for.
  EXPECT_FALSE(ReadJson(scratch + "/b/surface.json").contains("depth"));
  EXPECT_TRUE(Exists(scratch + "/a/map_0000"));
  EXPECT_FALSE(Exists(scratch + "/b/map_0000"));
}

// Depth that the engine searched while the scope moved, and kept: no sequence is needed, and nothing else of the run is
// changed by it.
TEST(Surface, IsMadeOfTheDepthThatTheRunKept) {
  const std::string scratch = ScratchFolder();
  const std::string kept = scratch + "/kept";
  const CommandResult run = Haustra({"run", SequenceFolder("depth"), "--out", kept, "--report", "off", "--surface",
                                     "off", "--device", "cpu", "--threads", "1", "--set", "depth.enabled=true"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  for (const char* name : {"/frames.csv", "/maps.csv", "/maps/map_0000/points3D.txt", "/maps/map_0000/images.txt"}) {
    EXPECT_EQ(ReadBytes(kept + name), ReadBytes(ResultFolder("depth") + name)) << name;
  }
  const nlohmann::json summary = ReadJson(kept + "/summary.json");
  EXPECT_GT(summary["depth"]["keyframes_with_depth"], 3) << summary["depth"].dump();
  EXPECT_EQ(summary["depth"]["pictures_refused"], 0);
  EXPECT_FALSE(summary.contains("surface"));
  EXPECT_FALSE(Exists(kept + "/surface"));

  const CommandResult judged = Haustra(
      {"surface", kept, "--out", scratch + "/a", "--groundtruth", SequenceFolder("depth") + "/groundtruth.txt"});
  ASSERT_EQ(judged.exit_code, 0) << judged.ToString();
  const nlohmann::json json = ReadJson(scratch + "/a/surface.json");
  const nlohmann::json& depth = json["depth"];
  // When this was written: 86.9 %, 2.7 %, 92.6 %, 2.2 mm, 11772 triangles.
  EXPECT_GT(depth["completeness"], 0.75) << depth.dump();
  EXPECT_LT(depth["median_error"], 0.04) << depth.dump();
  EXPECT_GT(depth["within_10_percent"], 0.85) << depth.dump();
  EXPECT_LT(depth["rms_mm"], 3.0) << depth.dump();
  EXPECT_GT(json["maps"][0]["triangles"], 8000);

  const CommandResult without = Haustra({"surface", ResultFolder("depth"), "--out", scratch + "/b"});
  EXPECT_NE(without.exit_code, 0);
  EXPECT_THAT(without.err, HasSubstr("the run kept no depth"));
  std::ofstream(kept + "/maps/map_0000/depth.bin", std::ios::binary | std::ios::trunc) << "no depth";
  const CommandResult damaged = Haustra({"surface", kept, "--out", scratch + "/b"});
  EXPECT_NE(damaged.exit_code, 0);
  EXPECT_THAT(damaged.err, HasSubstr("depth.bin: "));
  EXPECT_FALSE(Exists(scratch + "/b"));
}

// Five maps that were joined one after the other, some with keyframes that had their depth before: one mesh comes of
// it. Without looking for a place in the map itself, each loss leaves a map to be joined. (Their scales differ by a per
// cent: that depth grows with its map is tested in depth_keeper_test.cc.)
TEST(Surface, OfMapsThatWereJoinedIsOne) {
  const std::string scratch = ScratchFolder();
  const std::string out = scratch + "/out";
  const CommandResult run = Haustra({"run",       SequenceFolder("losses"),
                                     "--out",     out,
                                     "--report",  "off",
                                     "--surface", "off",
                                     "--device",  "cpu",
                                     "--threads", "2",
                                     "--set",     "relocalisation.min_inliers=8000",
                                     "--set",     "tracking.brute_force_recovery=false",
                                     "--set",     "depth.enabled=true",
                                     "--set",     "depth.step_px=8",
                                     "--set",     "depth.newer_keyframes=1"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  const nlohmann::json summary = ReadJson(out + "/summary.json");
  ASSERT_GE(summary["merges"], 2) << summary.dump();
  ASSERT_EQ(summary["maps"], 1) << summary.dump();
  const CommandResult judged = Haustra({"surface", out, "--out", scratch + "/surface", "--depth-maps", "--groundtruth",
                                        SequenceFolder("losses") + "/groundtruth.txt"});
  ASSERT_EQ(judged.exit_code, 0) << judged.ToString();
  // Keyframes from before the first loss and from after the last join have their depth.
  std::vector<int> frames;
  for (const std::string& name : FilesBelow(scratch + "/surface")) {
    if (name.starts_with("map_0000/")) frames.push_back(std::stoi(name.substr(std::strlen("map_0000/"))));
  }
  ASSERT_GT(frames.size(), 15u);
  int first_loss = -1, last_join = -1;
  for (const auto& event : ReadCsv(out + "/events.csv")) {
    if (event.at("event") == "lost" && first_loss < 0) first_loss = std::stoi(event.at("frame_idx"));
    if (event.at("event") == "merged") last_join = std::stoi(event.at("frame_idx"));
  }
  EXPECT_LT(*std::min_element(frames.begin(), frames.end()), first_loss);
  EXPECT_GT(*std::max_element(frames.begin(), frames.end()), last_join);
  const nlohmann::json json = ReadJson(scratch + "/surface/surface.json");
  ASSERT_EQ(json["maps"].size(), 1u);
  EXPECT_GT(json["maps"][0]["triangles"], 15000);
  EXPECT_EQ(json["maps"][0]["refused_blocks"], 0);
  // One Sim(3) for all of them: a part with another scale would be off. When this was written: 86.0 %, 4.1 %, 87.4 %.
  const nlohmann::json& depth = json["depth"];
  EXPECT_GT(depth["completeness"], 0.75) << depth.dump();
  EXPECT_LT(depth["median_error"], 0.055) << depth.dump();
  EXPECT_GT(depth["within_10_percent"], 0.75) << depth.dump();
}

// A run with depth ends with it: the same files as the command makes later, its coverage in the summary, its wall in
// the report. A run without depth in the same folder leaves none of it.
TEST(Surface, IsMadeAtTheEndOfARunThatKeptDepth) {
  const std::string scratch = ScratchFolder();
  const std::string out = scratch + "/out";
  const std::vector<std::string> arguments = {
      "run", SequenceFolder("standard"), "--out", out, "--device", "cpu", "--threads", "2"};
  std::vector<std::string> with_depth = arguments, without_depth = arguments;
  with_depth.insert(with_depth.end(),
                    {"--last-frame", "149", "--set", "depth.step_px=8", "--set", "depth.enabled=true"});
  without_depth.insert(without_depth.end(), {"--last-frame", "40", "--overwrite"});
  const CommandResult run = Haustra(with_depth);
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  const CommandResult again = Haustra({"surface", out, "--out", scratch + "/again"});
  ASSERT_EQ(again.exit_code, 0) << again.ToString();
  ASSERT_EQ(FilesBelow(out + "/surface"), FilesBelow(scratch + "/again"));
  for (const std::string& name : FilesBelow(scratch + "/again")) {
    EXPECT_EQ(ReadBytes(out + "/surface/" + name), ReadBytes(scratch + "/again/" + name)) << name;
  }
  const nlohmann::json surface = ReadJson(out + "/surface/surface.json")["maps"];
  const nlohmann::json summary = ReadJson(out + "/summary.json");
  ASSERT_EQ(summary["surface"]["made"], true);
  const nlohmann::json& maps = summary["surface"]["maps"];
  ASSERT_EQ(maps.size(), surface.size());
  for (std::size_t i = 0; i < maps.size(); ++i) {
    for (const auto& [name, value] : maps[i].items()) EXPECT_EQ(value, surface[i][name]) << name;
  }
  EXPECT_GT(maps[0]["wall_coverage"], 0.1) << maps.dump();
  EXPECT_FALSE(maps[0]["segments"].empty());
  EXPECT_THAT(run.out, HasSubstr("  wall          map 0: of the wall along "));
  const std::string page = ReadBytes(out + "/report.html");
  EXPECT_THAT(page, HasSubstr("The wall that was looked at"));
  EXPECT_THAT(page, HasSubstr("data:image/png;base64,"));

  const CommandResult without = Haustra(without_depth);
  ASSERT_EQ(without.exit_code, 0) << without.ToString();
  EXPECT_FALSE(Exists(out + "/surface"));
  EXPECT_FALSE(ReadJson(out + "/summary.json").contains("surface"));
}

TEST(Surface, WhenItCannotBeMadeTheRunStays) {
  const std::string out = ScratchFolder() + "/out";
  Command command(HaustraCommand({"run", SequenceFolder("depth"), "--out", out, "--device", "cpu", "--set",
                                  "depth.enabled=true", "--set", "depth.step_px=8"}));
  // The run has begun, and somebody puts a file where the surface is to go.
  while (command.IsRunning() && !Exists(out + "/maps")) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  std::filesystem::create_directories(out + "/surface");
  WriteBytes(out + "/surface/precious", "mine");
  const CommandResult run = command.Wait(kHangLimit);
  EXPECT_EQ(run.exit_code, 73) << run.ToString();
  EXPECT_THAT(run.err, HasSubstr("there is no surface: " + out + "/surface: holds 'precious'"));
  EXPECT_THAT(run.err, HasSubstr("the other results are whole"));
  EXPECT_THAT(run.out, HasSubstr("  wall          no surface: "));
  const nlohmann::json summary = ReadJson(out + "/summary.json");
  EXPECT_EQ(summary["surface"]["made"], false);
  EXPECT_THAT(summary["surface"]["reason"].get<std::string>(), HasSubstr("holds 'precious'"));
  EXPECT_EQ(summary["maps"], 1);
  EXPECT_TRUE(Exists(out + "/maps/map_0000/depth.bin"));
  EXPECT_TRUE(Exists(out + "/report.html"));
  EXPECT_EQ(ReadBytes(out + "/surface/precious"), "mine");
}

TEST(Surface, AFullVolumeIsCountedAndSaid) {
  const std::string scratch = ScratchFolder();
  std::vector<std::string> arguments = SurfaceArguments(scratch + "/small");
  arguments.insert(arguments.end(), {"--max-blocks", "100"});
  const CommandResult result = Haustra(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.ToString();
  EXPECT_THAT(result.out, HasSubstr("the volume is full"));
  const nlohmann::json map = ReadJson(scratch + "/small/surface.json")["maps"][0];
  EXPECT_EQ(map["blocks"], 100);
  EXPECT_GT(map["refused_blocks"], 0);
}

TEST(Surface, CoverageOfTheWallIsNearTheTruth) {
  const std::string scratch = ScratchFolder();
  const std::vector<std::string> arguments = {"surface",       ResultFolder("standard"),
                                              "--sequence",    SequenceFolder("standard"),
                                              "--out",         scratch + "/wall",
                                              "--groundtruth", SequenceFolder("standard") + "/groundtruth.txt",
                                              "--segment",     "100"};
  const CommandResult result = Haustra(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.ToString();
  EXPECT_THAT(result.out, HasSubstr("coverage of the wall against the truth"));
  const nlohmann::json json = ReadJson(scratch + "/wall/surface.json");
  EXPECT_EQ(json["maps"][0]["lumen"]["found"], true);
  EXPECT_FALSE(json.contains("depth")) << "there is no true depth beside this truth";
  // When this was written: -6.8 points, -6.3 of what was seen at all, 0.78, a false place of 89 mm2. With four other
  // seeds of the run up to -9.0, -8.9, 0.75 and 105 mm2. The aims are 5 points and 100 mm2.
  const nlohmann::json& coverage = json["coverage"];
  EXPECT_LT(coverage["worst_points"], 9.5) << coverage.dump();
  EXPECT_LT(coverage["worst_seen_points"], 9.5) << coverage.dump();
  EXPECT_GT(coverage["agreement"], 0.72) << coverage.dump();
  EXPECT_LT(coverage["largest_false_mm2"], 115.0) << coverage.dump();
  EXPECT_LE(coverage["false_well_mm2"], coverage["false_mm2"]) << coverage.dump();
  EXPECT_LT(coverage["false_mm2"], 450.0) << coverage.dump();
  EXPECT_TRUE(Exists(scratch + "/wall/map_0000_wall.png"));
  EXPECT_TRUE(Exists(scratch + "/wall/map_0000_wall.csv"));

  const CommandResult report =
      Haustra({"report", ResultFolder("standard"), "--surface", scratch + "/wall", "--html", scratch + "/report.html"});
  ASSERT_EQ(report.exit_code, 0) << report.ToString();
  EXPECT_THAT(ReadBytes(scratch + "/report.html"), HasSubstr("data:image/png;base64,"));
}

}  // namespace
}  // namespace haustra::end_to_end
