#include "tools/view/live_surface.h"

#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/tools/evaluate/text_folder.h"
#include "tests/tools/view/published_tube.h"
#include "tools/view/live_stream.h"
#include "tools/view/live_wall.h"

namespace haustra::view {
namespace {

class LiveSurfaceTest : public ::testing::Test {
 protected:
  // The scope goes up the tube by 6 radii, in 13 keyframes.
  void Fill(PublishedTube& tube, std::uint32_t map_id = 0) {
    for (std::uint32_t i = 0; i < 13; ++i) tube.Publish(i, tube.Keyframe(100 + 20 * i, 0.5 * i, map_id), true);
  }
  nlohmann::json Made() {
    atlas_.Update();
    const Result<LiveSurface> made = MakeLiveSurface(atlas_.maps(), options_);
    EXPECT_TRUE(made.ok()) << made.status().message();
    if (!made.ok()) return {};
    ply_ = made->ply;
    return nlohmann::json::parse(made->json);
  }
  // The newest that the stream tells.
  static nlohmann::json NextWall(LiveStream& stream) {
    const std::string begin = "event: wall\ndata: ";
    for (int i = 0; i < 3000; ++i) {  // a busy machine leaves the lowest priority little
      const std::string news = stream.Next();
      if (const std::size_t at = news.rfind(begin); at != std::string::npos) {
        return nlohmann::json::parse(news.substr(at + begin.size(), news.find("\n\n", at) - at - begin.size()));
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    return "nothing came";
  }

  evaluate::TextFolder folder_;
  LiveAtlas atlas_{folder_.path()};
  surface::SurfaceOptions options_;
  std::string ply_;
};

TEST_F(LiveSurfaceTest, AWallThatWasLookedAtIsSeen) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  Fill(tube);
  atlas_.Update();
  tube.PublishPose(345, 3.0);
  const nlohmann::json json = Made();
  EXPECT_EQ(json["map"], 0);
  EXPECT_EQ(json["t_s"], 13.8);
  EXPECT_EQ(json["keyframes"], 13);
  EXPECT_EQ(json["depths"], 13);
  ASSERT_EQ(json["lumen"]["found"], true);
  EXPECT_NEAR(json["lumen"]["radius_mu"].get<double>(), 1.0, 0.03);
  EXPECT_NEAR(json["lumen"]["passed_radii"].get<double>(), 6.0, 0.4);
  // What lies behind the first picture was never in one: two thirds of a radius of six. Beside it one keyframe sees the
  // wall, and three must agree.
  EXPECT_GT(json["wall_coverage"].get<double>(), 0.77);
  EXPECT_LT(json["wall_coverage"].get<double>(), 0.97);
  EXPECT_EQ(json["segments"].size(), 3u);
  EXPECT_GT(json["segments"][1]["wall_coverage"].get<double>(), 0.97);
  EXPECT_NEAR(json["scope"].get<double>(), 0.5, 0.05);
  EXPECT_TRUE(json["picture"].get<std::string>().starts_with("iVBORw0KGgo")) << "a PNG";
  EXPECT_GT(json["triangles"].get<int>(), 1000);
  EXPECT_TRUE(ply_.starts_with("ply\n"));
}

TEST_F(LiveSurfaceTest, WhatThePictureDoesNotShowIsNot) {
  PublishedTube tube(folder_.path());
  tube.Begin(1, false);
  Fill(tube);
  tube.PublishPose(345, 3.0);
  const nlohmann::json json = Made();
  // Half of the directions have a wall: no lumen is claimed.
  EXPECT_EQ(json["lumen"]["found"], false);
  EXPECT_FALSE(json["lumen"]["reason"].get<std::string>().empty());
  EXPECT_FALSE(json.contains("picture"));
  EXPECT_GT(json["triangles"].get<int>(), 500) << "the wall that was seen has a mesh all the same";
}

TEST_F(LiveSurfaceTest, AFullVolumeIsTold) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  Fill(tube);
  tube.PublishPose(345, 3.0);
  EXPECT_EQ(Made()["refused_blocks"], 0);
  options_.max_blocks = 100;
  EXPECT_GT(Made()["refused_blocks"].get<int>(), 100);
}

TEST_F(LiveSurfaceTest, NobodyWaitsForOneThatIsNotWanted) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  Fill(tube);
  tube.PublishPose(345, 3.0);
  atlas_.Update();
  const std::atomic<bool> stop{true};
  options_.stop = &stop;
  EXPECT_EQ(MakeLiveSurface(atlas_.maps(), options_).code(), StatusCode::kCancelled);
}

TEST_F(LiveSurfaceTest, ItIsThatOfTheMapThatTheScopeIsIn) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  Fill(tube, 4);
  tube.Publish(40, tube.Keyframe(900, 0.0, 5), false);
  tube.PublishPose(345, 3.0, 4);
  EXPECT_EQ(Made()["map"], 4);
  tube.PublishPose(901, 0.0, 5);
  atlas_.Update();
  EXPECT_EQ(MakeLiveSurface(atlas_.maps(), options_).code(), StatusCode::kNotFound) << "it has no depth yet";
}

// A join moves a map: its poses come before its keyframes.
TEST_F(LiveSurfaceTest, AMapThatWasMovedIsNotMixedWithWhatItWas) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  Fill(tube);
  tube.PublishPose(345, 3.0, 0, 7);
  const nlohmann::json json = Made();
  EXPECT_EQ(json["epoch"], 0) << "that of the keyframes";
  EXPECT_FALSE(json.contains("scope"));
  haustra_depth_keyframe moved = tube.Keyframe(100, 0.0);
  moved.map_epoch = 7;
  tube.table().PublishKeyframe(0, moved);
  atlas_.Update();
  EXPECT_EQ(MakeLiveSurface(atlas_.maps(), options_).code(), StatusCode::kNotFound);
}

// The scope went on beyond the last keyframe: there it has passed the lumen, too.
TEST_F(LiveSurfaceTest, FramesThatWereNoKeyframesCount) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  Fill(tube);
  tube.PublishPose(345, 3.0);
  const double without = Made()["lumen"]["passed_radii"];
  tube.PublishPose(360, 6.8);
  EXPECT_NEAR(Made()["lumen"]["passed_radii"].get<double>() - without, 0.8, 0.3);
}

// A viewer is told when there is a surface, and when there is none any more.
TEST_F(LiveSurfaceTest, TheStreamTellsOfTheWall) {
  auto tube = std::make_unique<PublishedTube>(folder_.path());
  tube->Begin(1);
  Fill(*tube);
  tube->PublishPose(345, 3.0);
  const auto wall = std::make_shared<const LiveWall>(folder_.path());
  LiveStream stream(folder_.path(), wall);
  nlohmann::json told = NextWall(stream);
  while (told.is_object() && told.empty()) told = NextWall(stream);  // the procedure before has ended
  EXPECT_EQ(told["lumen"]["found"], true);
  ASSERT_NE(wall->newest()->mesh, nullptr);
  EXPECT_TRUE(wall->newest()->mesh->bytes.starts_with("ply\n"));
  tube->table().Wipe();
  told = NextWall(stream);
  EXPECT_TRUE(told.is_object() && told.empty()) << told;
  EXPECT_EQ(wall->newest()->mesh, nullptr);
}

// After a loss the scope is in another map, whose keyframes have no depth yet.
TEST_F(LiveSurfaceTest, AMapWithoutAWallDoesNotKeepThatOfTheOneBefore) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  Fill(tube, 4);
  tube.PublishPose(345, 3.0, 4);
  const auto wall = std::make_shared<const LiveWall>(folder_.path());
  LiveStream stream(folder_.path(), wall);
  nlohmann::json told = NextWall(stream);
  while (told.is_object() && told.empty()) told = NextWall(stream);
  EXPECT_EQ(told["map"], 4);
  // A map that is moved has a wall again in a moment.
  haustra_depth_keyframe moved = tube.Keyframe(100, 0.0, 4);
  moved.map_epoch = 7;
  tube.table().PublishKeyframe(0, moved);
  std::this_thread::sleep_for(std::chrono::seconds(4));
  EXPECT_EQ(stream.Next().find("event: wall"), std::string::npos);
  tube.Publish(40, tube.Keyframe(900, 0.0, 5), false);
  tube.PublishPose(901, 0.0, 5);
  told = NextWall(stream);
  EXPECT_TRUE(told.is_object() && told.empty()) << told;
  EXPECT_EQ(wall->newest()->mesh, nullptr);
}

}  // namespace
}  // namespace haustra::view
