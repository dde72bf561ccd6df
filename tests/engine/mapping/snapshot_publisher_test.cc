#include "engine/mapping/snapshot_publisher.h"

#include <gtest/gtest.h>

#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

class SnapshotPublisherTest : public testing::Test {
 protected:
  SnapshotPublisherTest()
      : link_(3, SyntheticColon::kMaxFeatures, 4, 8000),
        places_(colon_.config(), std::pmr::get_default_resource()),
        state_(colon_.config(), colon_.camera(), colon_.device(), link_, nullptr, false,
               std::pmr::get_default_resource()),
        publisher_(state_, places_) {
    colon_.AddWall(0.0, 5.0, 1000);
    colon_.AddMap(&state_.atlas, 0.0, 2.0, 6, Sim3{});
    state_.newest = colon_.frames().back().keyframe;
    state_.active = state_.atlas.keyframe(state_.newest).map;
    map_id_ = state_.atlas.map(state_.active).id;
  }

  // What a tracker reads that has missed all before.
  const LocalMap& Read() {
    link_.snapshots.Refresh();
    return link_.snapshots.ReadSlot();
  }

  SyntheticColon colon_{7};
  TrackingLink link_;
  PlaceMailbox places_;
  MappingState state_;
  SnapshotPublisher publisher_;
  MapId map_id_ = kNoId;
};

TEST_F(SnapshotPublisherTest, AnswersStandInEverySnapshotAfterThem) {
  publisher_.AnnounceFounding(3);
  publisher_.Publish();
  publisher_.AnnounceRefusal(4);
  publisher_.Publish();
  EXPECT_EQ(Read().refused_proposal, 4u);
  // Settling and late joins publish, too, before the tracker looks.
  for (int i = 0; i < 5; ++i) publisher_.Publish();
  EXPECT_EQ(Read().version, 7u);
  EXPECT_EQ(Read().founding_proposal, 3u);
  EXPECT_EQ(Read().refused_proposal, 4u);
  publisher_.AnnounceRefusal(5);
  publisher_.Publish();
  EXPECT_EQ(Read().refused_proposal, 5u);
}

TEST_F(SnapshotPublisherTest, FoundFrameGoesAlongWithItsMap) {
  const SE3 pose = colon_.frames()[2].cam_from_world;
  publisher_.AnnounceFound(17, pose);
  // Its map is moved before the tracker has read it; then another map is.
  const Sim3 moved(1.3, ExpSO3({0.2, -0.1, 0.3}), {1.0, -2.0, 0.5});
  publisher_.Reframe({0, map_id_, map_id_, moved});
  publisher_.Reframe({0, map_id_ + 1, map_id_, Sim3(0.5, Eigen::Quaterniond::Identity(), {9, 9, 9})});
  publisher_.Publish();
  const FoundFrame found = Read().found_frame;
  EXPECT_EQ(found.sequence, 1u);
  EXPECT_EQ(found.frame_index, 17u);
  // The camera stands where its centre was taken.
  const Eigen::Vector3d centre = moved * pose.InverseTranslation();
  EXPECT_LT((found.cam_from_map.InverseTranslation() - centre).norm(), 1e-12);
}

TEST_F(SnapshotPublisherTest, PoseFollowsTheReframingsThatItHasNotSeen) {
  const Sim3 first(2.0, ExpSO3({0.1, 0.0, 0.0}), {1, 0, 0}), second(0.7, ExpSO3({0.0, 0.4, 0.0}), {0, 2, 0});
  publisher_.Reframe({0, 5, 6, first});
  publisher_.Reframe({0, 6, 6, second});
  const SE3 pose = colon_.frames()[1].cam_from_world;
  SE3 both = pose, later = pose, elsewhere = pose;
  MapId map_of_both = 5, map_of_later = 6, map_elsewhere = 9;
  publisher_.FollowReframings(0, &map_of_both, &both);
  publisher_.FollowReframings(1, &map_of_later, &later);
  publisher_.FollowReframings(0, &map_elsewhere, &elsewhere);
  EXPECT_EQ(map_of_both, 6u);
  EXPECT_LT((both.InverseTranslation() - second * (first * pose.InverseTranslation())).norm(), 1e-12);
  EXPECT_LT((later.InverseTranslation() - second * pose.InverseTranslation()).norm(), 1e-12);
  EXPECT_EQ(map_elsewhere, 9u);
  EXPECT_EQ(elsewhere.translation, pose.translation);
}

// Not before the tracker has used a snapshot that is younger than the set's retirement.
TEST_F(SnapshotPublisherTest, FeatureSetStaysWhileASnapshotMayNameIt) {
  const FeatureSetHandle set = colon_.device().CreateFeatureSet().value();
  const int num_free = colon_.device().num_free_feature_sets();
  publisher_.Publish();
  publisher_.Retire(set);
  publisher_.ReleaseRetired();
  link_.version_done = 1;
  publisher_.ReleaseRetired();
  EXPECT_EQ(colon_.device().num_free_feature_sets(), num_free);
  publisher_.Publish();
  link_.version_done = 2;
  publisher_.ReleaseRetired();
  EXPECT_EQ(colon_.device().num_free_feature_sets(), num_free + 1);
}

}  // namespace
}  // namespace haustra::test
