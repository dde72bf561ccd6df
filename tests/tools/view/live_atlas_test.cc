#include "tools/view/live_atlas.h"

#include <gtest/gtest.h>

#include "tests/tools/evaluate/text_folder.h"
#include "tests/tools/view/published_tube.h"

namespace haustra::view {
namespace {

class LiveAtlasTest : public ::testing::Test {
 protected:
  double HeightOf(const LiveFrame& frame) const {
    const std::optional<SE3> map_from_cam = atlas_.maps().MapFromCam(frame);
    EXPECT_TRUE(map_from_cam.has_value());
    return map_from_cam ? map_from_cam->translation.z() : -1e9;
  }

  evaluate::TextFolder folder_;
  LiveAtlas atlas_{folder_.path()};
};

TEST_F(LiveAtlasTest, WithoutAnEngineThereIsNothing) {
  EXPECT_FALSE(atlas_.Update());
  EXPECT_FALSE(atlas_.maps().camera.has_value());
}

TEST_F(LiveAtlasTest, KeyframesComeMoveAndGo) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  tube.Publish(0, tube.Keyframe(10, 1.0), true);
  tube.Publish(1, tube.Keyframe(11, 2.0), false);
  EXPECT_TRUE(atlas_.Update());
  EXPECT_FALSE(atlas_.Update()) << "nothing is new";
  ASSERT_EQ(atlas_.maps().keyframes.size(), 2u);
  const LiveKeyframe& first = atlas_.maps().keyframes.at(10);
  ASSERT_NE(first.depth, nullptr);
  EXPECT_EQ(first.depth->num_cells, static_cast<std::uint64_t>(PublishedTube::kWidth * PublishedTube::kHeight));
  EXPECT_EQ(first.map_from_cam.translation.z(), 1.0);
  EXPECT_EQ(atlas_.maps().keyframes.at(11).depth, nullptr);
  const std::shared_ptr<const haustra_depth> depth = first.depth;

  haustra_depth_keyframe moved = first.record;
  moved.position_mu[2] = 1.5;
  tube.table().PublishKeyframe(0, moved);
  tube.table().Clear(1);
  EXPECT_TRUE(atlas_.Update());
  ASSERT_EQ(atlas_.maps().keyframes.size(), 1u);
  EXPECT_EQ(atlas_.maps().keyframes.at(10).map_from_cam.translation.z(), 1.5);
  EXPECT_EQ(atlas_.maps().keyframes.at(10).depth, depth) << "it was not read again";
}

TEST_F(LiveAtlasTest, FramesMoveWithTheirKeyframes) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  tube.Publish(0, tube.Keyframe(10, 1.0), false);
  tube.Publish(1, tube.Keyframe(40, 4.0), false);
  ASSERT_TRUE(atlas_.Update());
  tube.PublishPose(14, 1.4);
  tube.PublishPose(16, 1.6);  // too soon after the one before
  tube.PublishPose(30, 3.0);
  tube.PublishPose(45, 4.5, 0, 7);  // of another epoch
  tube.PublishPose(60, 6.0, 9);     // of a map without keyframes
  EXPECT_TRUE(atlas_.Update());
  EXPECT_EQ(atlas_.maps().map_id, 9u);
  ASSERT_EQ(atlas_.maps().frames.size(), 2u);
  EXPECT_EQ(atlas_.maps().frames[0].keyframe_id, 10u);
  EXPECT_EQ(atlas_.maps().frames[1].keyframe_id, 40u);
  EXPECT_NEAR(HeightOf(atlas_.maps().frames[0]), 1.4, 1e-12);
  EXPECT_NEAR(HeightOf(atlas_.maps().frames[1]), 3.0, 1e-12);

  // A join: another map, moved, and twice as large.
  haustra_depth_keyframe joined = tube.Keyframe(10, 20.0, 3);
  joined.scale = 2.0;
  tube.table().PublishKeyframe(0, joined);
  EXPECT_TRUE(atlas_.Update());
  EXPECT_NEAR(HeightOf(atlas_.maps().frames[0]), 20.8, 1e-12);
  EXPECT_NEAR(HeightOf(atlas_.maps().frames[1]), 3.0, 1e-12);
}

TEST_F(LiveAtlasTest, FramesOfAKeyframeThatHasGoneStayWithItsNeighbour) {
  PublishedTube tube(folder_.path());
  tube.Begin(1);
  tube.Publish(0, tube.Keyframe(10, 1.0), false);
  tube.Publish(1, tube.Keyframe(20, 2.0), false);
  tube.Publish(2, tube.Keyframe(21, 2.1, 5), false);  // nearer in time, and of another map
  ASSERT_TRUE(atlas_.Update());
  tube.PublishPose(18, 1.8);
  ASSERT_TRUE(atlas_.Update());
  ASSERT_EQ(atlas_.maps().frames.at(0).keyframe_id, 20u);
  // Its neighbour moves with the same news.
  tube.table().Clear(1);
  tube.table().PublishKeyframe(0, tube.Keyframe(10, 1.3));
  ASSERT_TRUE(atlas_.Update());
  ASSERT_EQ(atlas_.maps().frames.size(), 1u);
  EXPECT_EQ(atlas_.maps().frames[0].keyframe_id, 10u);
  EXPECT_NEAR(HeightOf(atlas_.maps().frames[0]), 2.1, 1e-12);
  // With the last one of its map it goes.
  tube.table().Clear(0);
  ASSERT_TRUE(atlas_.Update());
  EXPECT_TRUE(atlas_.maps().frames.empty());
}

TEST_F(LiveAtlasTest, NothingOfAProcedureStaysAfterIt) {
  auto tube = std::make_unique<PublishedTube>(folder_.path());
  tube->Begin(1);
  tube->Publish(0, tube->Keyframe(10, 1.0), true);
  ASSERT_TRUE(atlas_.Update());
  tube->PublishPose(14, 1.4);
  ASSERT_TRUE(atlas_.Update());
  tube->table().Wipe();
  EXPECT_TRUE(atlas_.Update());
  EXPECT_FALSE(atlas_.maps().camera.has_value());
  EXPECT_TRUE(atlas_.maps().keyframes.empty());
  EXPECT_TRUE(atlas_.maps().frames.empty());
  EXPECT_EQ(atlas_.maps().map_id, HAUSTRA_NO_MAP);

  // The next one begins before anybody has looked.
  tube->Begin(2);
  tube->Publish(0, tube->Keyframe(10, 1.0), true);
  ASSERT_TRUE(atlas_.Update());
  tube->PublishPose(14, 1.4);
  ASSERT_TRUE(atlas_.Update());
  EXPECT_EQ(atlas_.maps().frames.size(), 1u);
  tube->Begin(3);
  EXPECT_TRUE(atlas_.Update());
  EXPECT_TRUE(atlas_.maps().keyframes.empty()) << "that of procedure 2";
  EXPECT_TRUE(atlas_.maps().frames.empty());

  // The service ends.
  tube.reset();
  EXPECT_TRUE(atlas_.Update());
  EXPECT_FALSE(atlas_.maps().camera.has_value());
  EXPECT_FALSE(atlas_.Update());
}

}  // namespace
}  // namespace haustra::view
