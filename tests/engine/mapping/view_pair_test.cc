// Matches of two keyframes, for epipolar geometry.
#include "engine/mapping/view_pair.h"

#include <gtest/gtest.h>

#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

// The text on a screen is the best match of all, and a bearing of zero agrees with every motion.
TEST(ViewPair, FeaturesWithoutABearingAreLeftOut) {
  SyntheticColon colon(7);
  colon.AddWall(0.0, 5.0, 1500);
  Atlas atlas = colon.MakeAtlas();
  const MapHandle map = atlas.CreateMap();
  const KeyframeHandle a = colon.AddKeyframe(&atlas, map, colon.ViewFrom(0.0), Sim3());
  const KeyframeHandle b = colon.AddKeyframe(&atlas, map, colon.ViewFrom(0.12), Sim3());
  const NoiseModel noise(colon.config().noise);
  ViewPair pair(colon.config(), noise, colon.camera(), colon.device());
  ASSERT_TRUE(pair.Compare(atlas.keyframe(a), atlas.keyframe(b)));
  const std::vector<Match> all(pair.matches().begin(), pair.matches().end());
  ASSERT_GT(all.size(), 100U);

  // Every fourth has none in the first view, the one after it none in the second.
  std::vector<Match> left;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i % 4 == 0) atlas.keyframe(a).features.bearings[all[i].query] = Bearing{};
    if (i % 4 == 1) atlas.keyframe(b).features.bearings[all[i].train] = Bearing{};
    if (i % 4 > 1) left.push_back(all[i]);
  }
  ASSERT_TRUE(pair.Compare(atlas.keyframe(a), atlas.keyframe(b)));
  ASSERT_EQ(pair.matches().size(), left.size());
  for (std::size_t i = 0; i < left.size(); ++i) {
    EXPECT_EQ(pair.matches()[i].query, left[i].query);
    EXPECT_EQ(pair.matches()[i].train, left[i].train);
    EXPECT_EQ(pair.bearings_a()[i], atlas.keyframe(a).features.bearing(left[i].query));
    EXPECT_EQ(pair.bearings_b()[i], atlas.keyframe(b).features.bearing(left[i].train));
  }
}

}  // namespace
}  // namespace haustra::test
