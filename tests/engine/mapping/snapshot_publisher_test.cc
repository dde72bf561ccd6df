#include "engine/mapping/snapshot_publisher.h"

#include <gtest/gtest.h>

#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

class SnapshotPublisherTest : public testing::Test {
 protected:
  SnapshotPublisherTest()
      : link_(colon_.config()),
        places_(colon_.config(), std::pmr::get_default_resource()),
        scene_(colon_.camera(), {}),
        state_(colon_.config(), colon_.camera(), scene_, colon_.device(), link_, nullptr, false,
               std::pmr::get_default_resource()),
        publisher_(state_, places_) {
    colon_.AddWall(0.0, 5.0, 1000);
    colon_.AddMap(&state_.atlas, 0.0, 2.0, 6, Sim3{});
    state_.newest = colon_.frames().back().keyframe;
    state_.active = state_.atlas.keyframe(state_.newest).map;
    map_id_ = state_.atlas.map(state_.active).id;
  }

  // What a tracker hears that has missed all snapshots before.
  template <typename Reply>
  Reply Hear(std::uint64_t version) {
    const VersionedReply* next = link_.replies.Front();
    EXPECT_NE(next, nullptr);
    if (next == nullptr) return {};
    EXPECT_EQ(next->version, version);
    const Reply* reply = std::get_if<Reply>(&next->reply);
    EXPECT_NE(reply, nullptr) << next->reply.index();
    const Reply heard = reply == nullptr ? Reply{} : *reply;
    link_.replies.Pop();
    return heard;
  }

  SyntheticColon colon_{7};
  TrackingLink link_;
  PlaceMailbox places_;
  SceneRegion scene_;
  MappingState state_;
  SnapshotPublisher publisher_;
  MapId map_id_ = kNoId;
};

TEST_F(SnapshotPublisherTest, RepliesAreHeardInTheirOrderHoweverManySnapshotsAreMissed) {
  const SE3 pose = colon_.frames()[2].cam_from_world;
  const Sim3 moved(1.3, ExpSO3({0.2, -0.1, 0.3}), {1.0, -2.0, 0.5});
  publisher_.AnnounceFound(17, pose);
  publisher_.Publish();
  publisher_.AnnounceRefusal(4);
  publisher_.Publish();
  publisher_.AnnounceNotFound();
  publisher_.Reframe({map_id_, map_id_, moved});
  publisher_.Publish();
  publisher_.AnnounceFounding(5);
  // Settling and late joins publish, too, before the tracker looks.
  for (int i = 0; i < 5; ++i) publisher_.Publish();
  link_.snapshots.Refresh();
  EXPECT_EQ(link_.snapshots.ReadSlot().version, 8u);
  const auto found = Hear<FrameFound>(1);
  EXPECT_EQ(found.frame_index, 17u);
  EXPECT_EQ(found.map_id, map_id_);
  EXPECT_EQ(found.cam_from_map.translation, pose.translation);
  EXPECT_EQ(Hear<MapRefused>(2).proposal, 4u);
  Hear<FrameNotFound>(2);  // it needs no snapshot of its own
  EXPECT_EQ(Hear<Reframing>(3).new_from_old.scale, moved.scale);
  const auto founded = Hear<MapFounded>(4);
  EXPECT_EQ(founded.proposal, 5u);
  EXPECT_EQ(founded.cam_from_map.translation, state_.atlas.keyframe(state_.newest).cam_from_map.translation);
  EXPECT_TRUE(link_.replies.is_empty());
}

TEST_F(SnapshotPublisherTest, RoomForOneMoreReplyIsSaid) {
  for (std::size_t i = 0; i < link_.replies.capacity(); ++i) {
    ASSERT_TRUE(publisher_.has_room()) << i;
    publisher_.AnnounceNotFound();
  }
  EXPECT_FALSE(publisher_.has_room());
  link_.replies.Pop();
  EXPECT_TRUE(publisher_.has_room());
  EXPECT_EQ(link_.replies.num_dropped(), 0u);
}

TEST_F(SnapshotPublisherTest, PoseFollowsTheReframingsThatItHasNotSeen) {
  const Sim3 first(2.0, ExpSO3({0.1, 0.0, 0.0}), {1, 0, 0}), second(0.7, ExpSO3({0.0, 0.4, 0.0}), {0, 2, 0});
  publisher_.Reframe({5, 6, first});
  publisher_.Reframe({6, 6, second});
  const SE3 pose = colon_.frames()[1].cam_from_world;
  SE3 both = pose, later = pose, elsewhere = pose;
  MapId map_of_both = 5, map_of_later = 6, map_elsewhere = 9;
  EXPECT_TRUE(publisher_.FollowReframings(0, &map_of_both, &both));
  EXPECT_TRUE(publisher_.FollowReframings(1, &map_of_later, &later));
  EXPECT_TRUE(publisher_.FollowReframings(0, &map_elsewhere, &elsewhere));
  EXPECT_EQ(map_of_both, 6u);
  EXPECT_LT((both.InverseTranslation() - second * (first * pose.InverseTranslation())).norm(), 1e-12);
  EXPECT_LT((later.InverseTranslation() - second * pose.InverseTranslation()).norm(), 1e-12);
  EXPECT_EQ(map_elsewhere, 9u);
  EXPECT_EQ(elsewhere.translation, pose.translation);
}

// A pose that would be put in a wrong place is better not put anywhere.
TEST_F(SnapshotPublisherTest, PoseThatMissedMoreReframingsThanAreOnRecordIsRefused) {
  constexpr int kTimes = 20;
  const Sim3 step(1.0, Eigen::Quaterniond::Identity(), {1, 0, 0});
  for (int i = 0; i < kTimes; ++i) publisher_.Reframe({5, 5, step});
  const SE3 pose = colon_.frames()[1].cam_from_world;
  SE3 stale = pose, recent = pose;
  MapId map_of_stale = 5, map_of_recent = 5;
  EXPECT_FALSE(publisher_.FollowReframings(0, &map_of_stale, &stale));
  EXPECT_EQ(stale.translation, pose.translation);
  EXPECT_TRUE(publisher_.FollowReframings(kTimes - 10, &map_of_recent, &recent));
  const Eigen::Vector3d centre = pose.InverseTranslation() + Eigen::Vector3d(10, 0, 0);
  EXPECT_LT((recent.InverseTranslation() - centre).norm(), 1e-12);
}

// What was known of it is of the former shape. Other maps have theirs still.
TEST_F(SnapshotPublisherTest, PoseInAMapThatWasBuiltAnewIsRefused) {
  publisher_.Reframe({4, 5, Sim3()});
  publisher_.Reframe({5, 5, Sim3(), false});
  const SE3 pose = colon_.frames()[1].cam_from_world;
  SE3 stale = pose, recent = pose, elsewhere = pose;
  MapId map_of_stale = 4, map_of_recent = 5, map_elsewhere = 9;
  EXPECT_FALSE(publisher_.FollowReframings(0, &map_of_stale, &stale));
  EXPECT_EQ(map_of_stale, 4u);
  EXPECT_EQ(stale.translation, pose.translation);
  EXPECT_TRUE(publisher_.FollowReframings(2, &map_of_recent, &recent));
  EXPECT_TRUE(publisher_.FollowReframings(0, &map_elsewhere, &elsewhere));
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
