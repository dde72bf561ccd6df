#include "engine/merging/bundle_window.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

// Ten keyframes along a tube; the window holds the last three.
class BundleWindowTest : public testing::Test {
 protected:
  BundleWindowTest()
      : colon_(3), atlas_(colon_.MakeAtlas()), window_(colon_.config().memory, noise_, colon_.camera(), adjuster_) {
    colon_.AddWall(0.0, 6.0, 2000);
    colon_.AddMap(&atlas_, 0.0, 2.0, 10, Sim3{});
    for (const int i : {9, 8, 7}) EXPECT_TRUE(window_.Add(KeyframeOf(i)));
  }
  KeyframeHandle KeyframeOf(int i) const { return colon_.frames()[i].keyframe; }
  // Points of the window that a keyframe outside sees.
  int NumSeen(int i) const {
    int num = 0;
    const Keyframe& keyframe = atlas_.keyframe(KeyframeOf(i));
    for (int f = 0; f < keyframe.features.num; ++f) {
      if (!keyframe.points[f]) continue;
      const MapPoint& point = atlas_.point(keyframe.points[f]);
      for (const KeyframeHandle moving : window_.moving()) {
        if (atlas_.FeatureOf(point, moving) < 0) continue;
        ++num;
        break;
      }
    }
    return num;
  }
  SE3 PoseOf(int i) const { return atlas_.keyframe(KeyframeOf(i)).cam_from_map; }

  SyntheticColon colon_;
  NoiseModel noise_{colon_.config().noise};
  Atlas atlas_;
  SchurBundleAdjuster adjuster_;
  BundleWindow window_;
};

TEST_F(BundleWindowTest, RingIsOfThoseThatSeeMostAndMayHold) {
  EXPECT_FALSE(window_.Add(KeyframeOf(8))) << "it has it already";
  const KeyframeHandle refused = KeyframeOf(6);
  window_.Close(atlas_, 3, [&](KeyframeHandle keyframe) { return !(keyframe == refused); });
  ASSERT_EQ(window_.num_fixed(), 3u);
  ASSERT_EQ(window_.problem().poses.size(), 6u);
  std::vector<int> votes;
  for (int i = 0; i < 6; ++i) votes.push_back(NumSeen(i));
  std::sort(votes.rbegin(), votes.rend());
  for (std::size_t i = 0; i < 6; ++i) {
    const BundlePose& pose = window_.problem().poses[i];
    EXPECT_EQ(pose.is_fixed, i >= 3);
    if (i < 3) continue;
    int which = -1;
    for (int k = 0; k < 10; ++k) {
      if (PoseOf(k).translation == pose.cam_from_world.translation) which = k;
    }
    ASSERT_GE(which, 0);
    EXPECT_EQ(NumSeen(which), votes[i - 3]);
    EXPECT_NE(which, 6);
  }
}

TEST_F(BundleWindowTest, WhatIsFixedStaysAndTheOthersAreWrittenBack) {
  const SE3 truth = PoseOf(9);
  atlas_.keyframe(KeyframeOf(9)).cam_from_map.translation += Eigen::Vector3d(0.06, -0.04, 0.03);
  const SE3 before = PoseOf(7), off = PoseOf(9), ring = PoseOf(5);
  window_.Close(atlas_, 4, {});
  window_.Fix(2);  // keyframe 7
  const Result<BundleSummary> summary = window_.Adjust({}, &atlas_);
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(PoseOf(7).translation, before.translation);
  EXPECT_EQ(PoseOf(5).translation, ring.translation);
  EXPECT_LT((PoseOf(9).translation - truth.translation).norm(), 0.5 * (off.translation - truth.translation).norm());
  EXPECT_EQ(window_.problem().poses[0].cam_from_world.translation, PoseOf(9).translation);
}

// The marks of one window do not reach the next, whatever has gone from the atlas meanwhile.
TEST_F(BundleWindowTest, ClearedWindowIsAsNew) {
  window_.Close(atlas_, 4, {});
  const int num_points = window_.num_points();
  ASSERT_TRUE(window_.Adjust({}, &atlas_).ok());
  window_.Clear();
  EXPECT_TRUE(window_.moving().empty());
  for (const int i : {9, 8, 7}) EXPECT_TRUE(window_.Add(KeyframeOf(i)));
  window_.Close(atlas_, 4, {});
  EXPECT_EQ(window_.num_fixed(), 4u);
  EXPECT_NEAR(window_.num_points(), num_points, 0.2 * num_points);
}

}  // namespace
}  // namespace haustra::test
