#include "tools/run/scene_depth.h"

#include <gtest/gtest.h>

namespace haustra {
namespace {

constexpr int kFeatures = 8;

// Keyframes that look along z, each at a place of its own, with what they see at written depths.
class SceneDepthTest : public testing::Test {
 protected:
  KeyframeHandle Add(MapHandle map, double at_z, std::initializer_list<double> depths) {
    FrameFeatures features(kFeatures);
    features.set = {next_frame_, 7};
    features.num = kFeatures;
    for (int i = 0; i < kFeatures; ++i) features.keypoints[i].scale_px = 2.0f;
    const SE3 cam_from_map(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, -at_z));
    const KeyframeHandle keyframe = atlas_.AddKeyframe(map, next_frame_++, TimePoint{}, cam_from_map, features);
    int feature = 0;
    for (const double depth : depths) {
      const MapPointHandle point = atlas_.AddPoint(map, {3.0, -4.0, at_z + depth}, 0);
      EXPECT_TRUE(atlas_.AddObservation(point, keyframe, feature++));
    }
    return keyframe;
  }

  Atlas atlas_{{64, 400, 4, 100, kFeatures}};
  std::uint32_t next_frame_ = 0;
};

TEST_F(SceneDepthTest, IsTheMedianOfWhatLiesInFront) {
  const MapHandle map = atlas_.CreateMap();
  const KeyframeHandle keyframe = Add(map, 10.0, {2.0, 9.0, -5.0, 4.0, -1.0});
  const auto depth = SceneDepthOf(atlas_.keyframe(keyframe), atlas_);
  ASSERT_TRUE(depth.has_value());
  EXPECT_DOUBLE_EQ(*depth, 4.0);
  EXPECT_FALSE(SceneDepthOf(atlas_.keyframe(Add(map, 0.0, {-2.0, -3.0})), atlas_).has_value());
}

TEST_F(SceneDepthTest, PercentilesAreThoseOfEachMapAlone) {
  const MapHandle first = atlas_.CreateMap(), second = atlas_.CreateMap();
  for (int i = 40; i >= 1; --i) Add(first, 7.0 * i, {0.5 * i, 0.5 * i, 100.0});
  Add(second, 0.0, {0.25});
  Add(second, 0.0, {-0.25});
  const std::vector<SceneDepths> depths = FindSceneDepths(atlas_);
  ASSERT_EQ(depths.size(), 2u);
  EXPECT_EQ(depths[0].map_id, atlas_.map(first).id);
  EXPECT_EQ(depths[0].num_keyframes, 40u);
  EXPECT_NEAR(depths[0].p5, 1.0, 1e-12);  // nearest rank: the second of forty
  EXPECT_NEAR(depths[0].p50, 10.0, 1e-12);
  EXPECT_NEAR(depths[0].p95, 19.0, 1e-12);
  EXPECT_EQ(depths[1].map_id, atlas_.map(second).id);
  EXPECT_EQ(depths[1].num_keyframes, 1u);
  EXPECT_EQ(depths[1].p95, 0.25);
}

TEST_F(SceneDepthTest, OfAnEmptyAtlasThereIsNone) { EXPECT_TRUE(FindSceneDepths(atlas_).empty()); }

}  // namespace
}  // namespace haustra
