// What the tracker makes of what the mapper tells it, however late it looks.
#include <memory>

#include "tests/engine/tracking/tracker_with_mapper.h"

namespace haustra::test {
namespace {

class MapRepliesTest : public TrackerWithMapper {
 protected:
  // What the mapper does when it moves its map: it tells so, and publishes what the map has become.
  void MoveMap(const Sim3& new_from_old) {
    if (newest_ == nullptr) {
      link_.snapshots.Refresh();
      newest_ = std::make_unique<LocalMap>(link_.snapshots.ReadSlot());
    }
    ++newest_->version;
    for (LocalKeyframe& keyframe : newest_->keyframes) {
      keyframe.cam_from_map = TransformPose(keyframe.cam_from_map, new_from_old);
      keyframe.centroid = new_from_old * keyframe.centroid;
    }
    for (LocalPoint& point : newest_->points) {
      point.position = new_from_old * point.position;
      point.normal = new_from_old.rotation * point.normal;
      point.scale_times_distance *= new_from_old.scale;
    }
    ASSERT_TRUE(link_.replies.TryPush({newest_->version, Reframing{newest_->map_id, newest_->map_id, new_from_old}}));
  }
  void Publish() {
    link_.snapshots.WriteSlot() = *newest_;
    link_.snapshots.Publish();
  }

  std::unique_ptr<LocalMap> newest_;
};

TEST_F(MapRepliesTest, PoseGoesAlongHoweverOftenTheMapIsMovedBeforeItIsRead) {
  const FrameResult before = TrackAndMap(60);
  ASSERT_EQ(before.reason, TrackingReason::kTracked);
  const Sim3 step(0.9, ExpSO3({0.1, -0.2, 0.0}), {0.3, 0.0, -0.2});
  constexpr int kTimes = 12;
  for (int i = 0; i < kTimes; ++i) {
    MoveMap(step);
    Publish();
  }
  const FrameResult after = TrackNext();
  EXPECT_EQ(after.map_epoch, before.map_epoch + kTimes);
  ASSERT_EQ(after.reason, TrackingReason::kTracked) << ToString(after.reason);
  Eigen::Vector3d centre = before.cam_from_map.InverseTranslation();
  double unit = 1.0;
  for (int i = 0; i < kTimes; ++i) {
    centre = step * centre;
    unit *= step.scale;
  }
  EXPECT_LT((after.cam_from_map.InverseTranslation() - centre).norm(), 0.1 * unit) << "a frame's way";
}

// Told and not yet published: the snapshot that is read shows the map where it was.
TEST_F(MapRepliesTest, ReplyIsNotHeardBeforeItsSnapshotIsThere) {
  const FrameResult before = TrackAndMap(60);
  MoveMap(Sim3(0.5, Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0}));
  const FrameResult between = TrackNext();
  EXPECT_EQ(between.reason, TrackingReason::kTracked);
  EXPECT_EQ(between.map_epoch, before.map_epoch);
  Publish();
  const FrameResult after = TrackNext();
  EXPECT_EQ(after.reason, TrackingReason::kTracked);
  EXPECT_EQ(after.map_epoch, before.map_epoch + 1);
}

// Settling may have so many rounds that no reader keeps up with them.
TEST(TrackingLink, RingHasRoomForEverySliceOfSettlingAfterEveryJoin) {
  EngineConfig config = SmallEngineConfig();
  config.memory.max_proposals = 4;
  config.merging.settling_rounds = 100;
  const TrackingLink link(config);
  EXPECT_GE(link.replies.capacity(), 4u + (4u + 2u) * (1u + 100u));
}

}  // namespace
}  // namespace haustra::test
