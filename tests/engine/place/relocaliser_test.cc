#include "engine/place/relocaliser.h"

#include <gtest/gtest.h>

#include "engine/place/exhaustive_retrieval.h"
#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

class RelocaliserTest : public testing::Test {
 protected:
  RelocaliserTest() : colon_(31), atlas_(colon_.MakeAtlas()), elsewhere_(colon_.MakeAtlas()) {}

  // The features of a frame that is in no map (it is kept in an atlas of its own).
  const FrameFeatures& See(const SE3& cam_from_world) {
    if (!other_map_) other_map_ = elsewhere_.CreateMap();
    return elsewhere_.keyframe(colon_.AddKeyframe(&elsewhere_, other_map_, cam_from_world, Sim3{})).features;
  }

  bool Relocalise(const FrameFeatures& features) {
    ExhaustiveRetrieval retrieval(colon_.config(), place_.retrieval, colon_.device());
    atlas_.keyframes().ForEach(
        [&](KeyframeHandle handle, const Keyframe&) { EXPECT_TRUE(retrieval.Add(atlas_, handle).ok()); });
    Relocaliser relocaliser(colon_.config(), place_.relocalisation, noise_, place_.retrieval, colon_.camera(),
                            colon_.scene(), colon_.device(), retrieval);
    return relocaliser.Relocalise(atlas_, features, &found_, &tried_);
  }

  SyntheticColon colon_;
  NoiseModel noise_{colon_.config().noise};
  Atlas atlas_;
  Atlas elsewhere_;
  MapHandle other_map_;
  PlaceConfig place_;
  Relocalisation found_;
  std::vector<RelocalisationCounts> tried_;
  const Sim3 map_from_world_{1.7, ExpSO3({0.1, 0.4, -0.9}), {2.0, 0.5, -3.0}};
};

TEST_F(RelocaliserTest, FindsThePoseInTheMap) {
  colon_.AddWall(0.0, 12.0, 4000);
  colon_.AddMap(&atlas_, 0.0, 8.0, 30, map_from_world_);
  const SE3 view = colon_.ViewFrom(4.1);
  ASSERT_TRUE(Relocalise(See(view)));
  const SE3 truth = TransformPose(view, map_from_world_);
  EXPECT_LT((found_.cam_from_map.InverseTranslation() - truth.InverseTranslation()).norm() / map_from_world_.scale,
            0.01);
  EXPECT_LT(RotationAngle(found_.cam_from_map.rotation, truth.rotation), 0.005);
  EXPECT_EQ(found_.counts.map_id, 0u);
  EXPECT_GE(found_.counts.num_inliers, 150);
  // The reference stands near: keyframes lie 0.28 apart.
  ASSERT_NE(atlas_.GetKeyframe(found_.reference), nullptr);
  const Eigen::Vector3d reference = colon_.FrameOf(found_.reference).cam_from_world.InverseTranslation();
  EXPECT_LT((reference - view.InverseTranslation()).norm(), 1.0);
}

TEST_F(RelocaliserTest, UnknownWallHasNoCandidate) {
  colon_.AddWall(0.0, 24.0, 8000);
  colon_.AddMap(&atlas_, 0.0, 8.0, 30, map_from_world_);
  EXPECT_FALSE(Relocalise(See(colon_.ViewFrom(15.0))));
  ASSERT_EQ(tried_.size(), 1u);
  EXPECT_EQ(ToString(tried_[0].verdict), "no_candidate");
}

TEST_F(RelocaliserTest, AlikeWallOfOtherShapeIsRefused) {
  RecordProperty("req", "MRG-001");
  const int wall = colon_.AddWall(0.0, 7.0, 2500);
  colon_.AddTwin(wall, 2500, 20.0, 0.45);
  colon_.AddMap(&atlas_, 0.0, 4.0, 16, map_from_world_);
  for (const double z : {20.5, 21.5, 22.5}) {
    EXPECT_FALSE(Relocalise(See(colon_.ViewFrom(z)))) << "z " << z;
    EXPECT_GE(tried_.size(), 1u);
    EXPECT_GE(tried_[0].num_matches, 100);
    EXPECT_EQ(ToString(tried_[0].verdict), "low_match_share");
  }
}

// Two places that cannot be told apart: the better one of two guesses is a guess.
TEST_F(RelocaliserTest, SecondPlaceThatAgreesMakesItAmbiguous) {
  RecordProperty("req", "MRG-001");
  // A multiple of 97: the responses of the copy are the same, too.
  const int wall = colon_.AddWall(0.0, 7.0, 25 * 97);
  colon_.AddTwin(wall, 25 * 97, 20.0, 0.0, true);
  colon_.AddMap(&atlas_, 0.0, 24.0, 90, map_from_world_);
  EXPECT_FALSE(Relocalise(See(colon_.ViewFrom(2.1))));
  ASSERT_GE(tried_.size(), 1u);
  EXPECT_EQ(ToString(tried_.back().verdict), "ambiguous");
}

// The scope stands between two walls that cannot be told apart, and looks at one of them.
TEST_F(RelocaliserTest, SecondPlaceSeenFromTheSamePositionMakesItAmbiguous) {
  RecordProperty("req", "MRG-001");
  const int wall = colon_.AddWall(3.0, 10.0, 25 * 97);
  const SE3 turned(ExpSO3({0.0, std::numbers::pi, 0.0}), {0.0, 0.0, 6.0});  // about (0, 0, 3)
  colon_.AddMovedTwin(wall, 25 * 97, turned);
  colon_.AddMapOfTwins(&atlas_, 2.9, 4.5, 16, turned, map_from_world_);
  EXPECT_FALSE(Relocalise(See(colon_.ViewFrom(3.02))));
  ASSERT_GE(tried_.size(), 1u);
  EXPECT_EQ(ToString(tried_.back().verdict), "ambiguous");
}

TEST_F(RelocaliserTest, LostDeviceIsReported) {
  colon_.AddWall(0.0, 12.0, 4000);
  colon_.AddMap(&atlas_, 0.0, 8.0, 30, map_from_world_);
  const FrameFeatures& features = See(colon_.ViewFrom(4.1));
  colon_.device().SetLost(true);
  EXPECT_FALSE(Relocalise(features));
  ASSERT_EQ(tried_.size(), 1u);
  EXPECT_EQ(ToString(tried_[0].verdict), "device_failed");
}

}  // namespace
}  // namespace haustra::test
