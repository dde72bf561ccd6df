#include "engine/place/common_area.h"

#include <gtest/gtest.h>

#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

class CommonAreaTest : public testing::Test {
 protected:
  CommonAreaTest() : colon_(7), atlas_(colon_.MakeAtlas()), rng_(3) {}

  bool Verify(int frame_a, int frame_b) {
    CommonAreaVerifier verifier(colon_.config(), options_, noise_, colon_.camera(), colon_.scene(), colon_.device());
    return colon_.Verify(verifier, atlas_, colon_.frames()[frame_a].keyframe, colon_.frames()[frame_b].keyframe, rng_,
                         &area_);
  }
  std::string_view verdict() const { return ToString(area_.counts.verdict); }

  SyntheticColon colon_;
  NoiseModel noise_{colon_.config().noise};
  Atlas atlas_;
  Rng rng_;
  CommonAreaConfig options_;
  CommonArea area_;
  const Sim3 map_from_world_{2.5, ExpSO3({0.3, -0.8, 0.5}), {4.0, -2.0, 1.0}};
};

TEST_F(CommonAreaTest, OverlappingMapsGiveTheirSimilarity) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  // z = 2.46 of the second map against z = 2.54 of the first.
  ASSERT_TRUE(Verify(first + 2, 11)) << verdict();
  const Sim3 truth = map_from_world_.Inverse();
  const Eigen::Vector3d centre = atlas_.keyframe(area_.keyframe_a).cam_from_map.InverseTranslation();
  const Sim3Error error = ErrorAt(area_.b_from_a, truth, centre, 1.5);
  EXPECT_LT(error.position, 0.01);
  EXPECT_LT(error.rotation_deg, 0.3);
  EXPECT_LT(error.scale, 0.01);
  EXPECT_GE(area_.points.size(), 100u);
  int num_wrong = 0;
  for (const CommonPoint& common : area_.points) {
    const auto& a = colon_.LandmarkOf(atlas_.point(common.point_a));
    const auto& b = colon_.LandmarkOf(atlas_.point(common.point_b));
    if (!(a.appearance == b.appearance)) ++num_wrong;
  }
  EXPECT_EQ(num_wrong, 0);
  EXPECT_GE(area_.counts.num_confirming, 1);
}

// As on living tissue: the younger map has its points at rough depths, seen from the keyframe that made each.
void RoughenDepths(double share, MapHandle map, Atlas* atlas) {
  Rng rng(9);
  atlas->points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
    if (!(point.map == map)) return;
    const Keyframe& observer = atlas->keyframe(point.observations.begin()->keyframe);
    const Eigen::Vector3d centre = observer.cam_from_map.InverseTranslation();
    const double factor = 1.0 + rng.Uniform(-share, share);
    atlas->point(handle).position = centre + factor * (point.position - centre);
  });
}

TEST_F(CommonAreaTest, PosesOfSeveralKeyframesTellWhatRoughPointsDoNot) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  const KeyframeHandle a = colon_.frames()[first + 2].keyframe;
  RoughenDepths(0.4, atlas_.keyframe(a).map, &atlas_);
  options_.ransac_iterations = 10;  // too few to meet three pairs that happen to be good, as wrong matches make it
  options_.min_inlier_share = 0.2;  // of points so rough
  ASSERT_TRUE(Verify(first + 2, 11)) << verdict();
  EXPECT_EQ(area_.counts.num_ransac_inliers, 0) << "three pairs of points told the similarity";
  const Eigen::Vector3d centre = atlas_.keyframe(a).cam_from_map.InverseTranslation();
  const Sim3Error error = ErrorAt(area_.b_from_a, map_from_world_.Inverse(), centre, 1.5);
  EXPECT_LT(error.position, 0.05);
  EXPECT_LT(error.rotation_deg, 1.0);
  EXPECT_LT(error.scale, 0.1);
}

// A patch leaves open whether the scope was turned or moved aside, however many keyframes agree on it.
TEST_F(CommonAreaTest, PosesOfSeveralKeyframesNeedMoreThanAPatch) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 9.0, 6000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  const MapHandle young_map = atlas_.keyframe(colon_.frames()[first].keyframe).map;
  for (const KeyframeHandle handle : atlas_.map(young_map).keyframes) {
    const Keyframe& keyframe = atlas_.keyframe(handle);
    for (int i = 0; i < keyframe.features.num; ++i) {
      const bool is_near = (keyframe.features.pixel(i) - Eigen::Vector2d(200.0, 268.0)).norm() < 75.0;
      if (keyframe.points[i] && !is_near) atlas_.RemoveObservation(keyframe.points[i], handle);
    }
  }
  options_.ransac_iterations = 0;  // three pairs of points tell nothing
  EXPECT_FALSE(Verify(first + 2, 11));
  EXPECT_EQ(verdict(), "low_spread");
  EXPECT_EQ(area_.counts.num_ransac_inliers, 0);
  options_.min_spread = 0.02;
  EXPECT_TRUE(Verify(first + 2, 11)) << verdict() << ": it is refused for another reason, too";
}

// A young map that has bent: keyframes from `first` on, with the points that they made, stand elsewhere.
void Bend(const Sim3& bent_from_map, KeyframeId first, MapHandle map, Atlas* atlas) {
  atlas->points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
    if (!(point.map == map)) return;
    const auto& views = point.observations;
    const auto num_bent = std::count_if(views.begin(), views.end(), [&](const Observation& view) {
      return atlas->keyframe(view.keyframe).id >= first;
    });
    if (2 * num_bent >= static_cast<std::ptrdiff_t>(views.size())) {
      atlas->point(handle).position = bent_from_map * point.position;
    }
  });
  for (const KeyframeHandle handle : atlas->map(map).keyframes) {
    Keyframe& keyframe = atlas->keyframe(handle);
    if (keyframe.id >= first) keyframe.cam_from_map = TransformPose(keyframe.cam_from_map, bent_from_map);
  }
}

// Half of the keyframes tell one similarity, half of them another one: neither is to be trusted.
TEST_F(CommonAreaTest, KeyframesThatTellTwoSimilaritiesTellNone) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 1.5, 3.5, 14, Sim3{}).first;
  const Keyframe& query = atlas_.keyframe(colon_.frames()[first + 4].keyframe);
  options_.min_ransac_inliers = 8000;  // so that pairs of points tell nothing
  Bend(Sim3(1.0, ExpSO3({0.02, 0.0, 0.0}), {0.06, 0.0, 0.0}), query.id, query.map, &atlas_);
  EXPECT_FALSE(Verify(first + 4, 9));
  EXPECT_EQ(verdict(), "no_similarity");
  options_.max_group_disagreement = 100.0;
  EXPECT_FALSE(Verify(first + 4, 9));
  EXPECT_EQ(verdict(), "few_inliers") << "one of the two was believed";
}

// Inside one map tracking knows better.
TEST_F(CommonAreaTest, PosesOfSeveralKeyframesCloseNoLoop) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  const MapHandle old_map = atlas_.keyframe(colon_.frames()[0].keyframe).map;
  const MapHandle young_map = atlas_.keyframe(colon_.frames()[first].keyframe).map;
  RoughenDepths(0.4, young_map, &atlas_);
  options_.ransac_iterations = 10;
  options_.min_inlier_share = 0.2;
  ASSERT_TRUE(Verify(first + 2, 11)) << verdict();
  for (const auto& frame : colon_.frames()) atlas_.keyframe(frame.keyframe).map = old_map;
  EXPECT_FALSE(Verify(first + 2, 11));
  EXPECT_EQ(verdict(), "no_similarity");
}

// A quarter of what two keyframes show in common has two points, the rest has one.
TEST_F(CommonAreaTest, AWallThatIsMappedOnceIsNotClosed) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 9.0, 3000);
  const MapHandle map = atlas_.CreateMap();
  for (int i = 0; i < 16; ++i) colon_.AddKeyframe(&atlas_, map, colon_.ViewFrom(0.5 + 0.1 * (i % 8)), Sim3{});
  colon_.AddPoints(&atlas_, 0, 16, 0.005,
                   [](int frame, int landmark) { return frame >= 8 && landmark % 4 == 0 ? 1 : 0; });
  EXPECT_FALSE(Verify(12, 4));
  EXPECT_EQ(verdict(), "mapped_once");
  EXPECT_GE(area_.counts.num_matches, options_.min_matches);
  EXPECT_GT(area_.counts.num_one, area_.counts.num_matches);
  // Three keyframes show most of them, and each counts once.
  EXPECT_LT(area_.counts.num_one, 0.8 * area_.counts.num_points_a);
  colon_.config().place.common_area.group_size = 1;
  EXPECT_FALSE(Verify(12, 4));
  EXPECT_GT(area_.counts.num_one, area_.counts.num_matches);
  options_.min_doubled = 0.1;
  EXPECT_TRUE(Verify(12, 4)) << verdict() << ": it is refused for another reason, too";
}

TEST_F(CommonAreaTest, SameInputGivesTheSameBits) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  rng_ = Rng(5);
  ASSERT_TRUE(Verify(first + 2, 11));
  const CommonArea once = area_;
  rng_ = Rng(5);
  ASSERT_TRUE(Verify(first + 2, 11));
  EXPECT_EQ(area_.b_from_a.scale, once.b_from_a.scale);
  EXPECT_EQ(area_.b_from_a.translation, once.b_from_a.translation);
  EXPECT_EQ(area_.points.size(), once.points.size());
}

TEST_F(CommonAreaTest, PlacesApartHaveFewMatches) {
  colon_.AddWall(0.0, 24.0, 8000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 12.0, 15.0, 14, map_from_world_).first;
  EXPECT_FALSE(Verify(first + 5, 5));
  EXPECT_EQ(verdict(), "few_matches");
  EXPECT_EQ(area_.counts.num_matches, 0);
  EXPECT_GT(area_.counts.num_points_a, 100);
}

TEST_F(CommonAreaTest, AlikeWallOfOtherShapeHasLowMatchShare) {
  RecordProperty("req", "MRG-001");
  const int wall = colon_.AddWall(0.0, 7.0, 2500);
  colon_.AddTwin(wall, 2500, 20.0, 0.3);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 20.0, 23.0, 14, map_from_world_).first;
  for (int i = 0; i < 14; i += 3) {
    EXPECT_FALSE(Verify(first + i, i)) << "keyframe " << i;
    EXPECT_GE(area_.counts.num_matches, 100);
    EXPECT_EQ(verdict(), "low_match_share");
  }
}

TEST_F(CommonAreaTest, TwinPlaceOfOneMapIsNoDrift) {
  RecordProperty("req", "MRG-001");
  const int wall = colon_.AddWall(0.0, 7.0, 2500);
  colon_.AddTwin(wall, 2500, 8.0, 0.0);
  const int first = colon_.AddMap(&atlas_, 0.0, 11.0, 48, Sim3{}).first;
  // z = 0.94 and z = 8.9: the same picture.
  EXPECT_FALSE(Verify(first + 38, first + 4));
  EXPECT_EQ(verdict(), "implausible_drift");
  EXPECT_NEAR(area_.counts.drift_share, 1.0, 0.2);
}

TEST_F(CommonAreaTest, NeighboursThatDisagreeRefuse) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const auto [first, last] = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_);
  for (int f = first; f < last; ++f) {
    if (f == first + 2) continue;
    Keyframe& keyframe = atlas_.keyframe(colon_.frames()[f].keyframe);
    keyframe.cam_from_map = SE3(ExpSO3({0.0, 0.0, 0.5}), Eigen::Vector3d::Zero()) * keyframe.cam_from_map;
  }
  EXPECT_FALSE(Verify(first + 2, 11));
  EXPECT_EQ(verdict(), "unconfirmed");
  EXPECT_EQ(area_.counts.num_confirming, 0);
  EXPECT_GE(area_.counts.num_neighbours, 1);
}

TEST_F(CommonAreaTest, OppositeScaleOfUnitsIsRefused) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const Sim3 tiny(0.01, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, tiny).first;
  EXPECT_FALSE(Verify(first + 2, 11));
  EXPECT_EQ(verdict(), "implausible_scale");
}

TEST_F(CommonAreaTest, PointsInOneCornerAreRefused) {
  colon_.AddWall(0.0, 9.0, 6000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  // Of the new keyframe only what it sees in one part of the image is known.
  const KeyframeHandle handle = colon_.frames()[first + 2].keyframe;
  const Keyframe& keyframe = atlas_.keyframe(handle);
  for (int i = 0; i < keyframe.features.num; ++i) {
    const bool is_near = (keyframe.features.pixel(i) - Eigen::Vector2d(200.0, 268.0)).norm() < 75.0;
    if (keyframe.points[i] && !is_near) atlas_.RemoveObservation(keyframe.points[i], handle);
  }
  ASSERT_GE(keyframe.num_points, 40);
  EXPECT_FALSE(Verify(first + 2, 11));
  EXPECT_EQ(verdict(), "low_spread");
}

TEST_F(CommonAreaTest, KeyframeWithoutPointsIsRefused) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const MapHandle map = atlas_.CreateMap();
  colon_.AddKeyframe(&atlas_, map, colon_.ViewFrom(2.0), map_from_world_);
  EXPECT_FALSE(Verify(14, 8));
  EXPECT_EQ(verdict(), "few_points");
}

TEST_F(CommonAreaTest, FailingDeviceIsNoProof) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  colon_.device().SetLost(true);
  EXPECT_FALSE(Verify(first + 2, 11));
  EXPECT_EQ(verdict(), "device_failed");
}

}  // namespace
}  // namespace haustra::test
