// The surface of a rendered colon, against the depth that the renderer knows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  // When this was written: 8 keyframes, 90.7 %, 4.5 %, 82.8 %, 18172 triangles.
  EXPECT_GT(depth["keyframes"], 3);
  EXPECT_GT(depth["completeness"], 0.8) << depth.dump();
  EXPECT_LT(depth["median_error"], 0.06) << depth.dump();
  EXPECT_GT(depth["within_10_percent"], 0.7) << depth.dump();
  EXPECT_GT(json["maps"][0]["triangles"], 9000);
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

}  // namespace
}  // namespace haustra::end_to_end
