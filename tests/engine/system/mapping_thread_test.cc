// What the mapper does for a tracker that is waiting for it, in real-time mode worked by hand.
#include <gtest/gtest.h>

#include <functional>

#include "engine/mapping/mapper.h"
#include "engine/tracking/tracker.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

// A clock that tells when somebody looks.
class WatchedClock final : public Clock {
 public:
  TimePoint Now() const override {
    if (on_look) on_look();
    return TimePoint(std::chrono::milliseconds(1));
  }
  std::function<void()> on_look;
};

class MappingThread : public testing::Test {
 protected:
  MappingThread()
      : scene_(colon_.camera(), {}),
        link_(config_),
        places_(config_, std::pmr::get_default_resource()),
        mapper_(config_, colon_.camera(), scene_, colon_.device(), link_, places_, &clock_, true, nullptr),
        tracker_(config_, colon_.camera(), scene_, colon_.device(), link_, nullptr) {
    colon_.config().merging.enabled = false;
    colon_.Move(0.0, 8.0, 200);
  }

  // Frames until the tracker has proposed a keyframe, with `num_before` keyframes in the map.
  void RunToProposal(std::uint64_t num_before) {
    while (mapper_.counters().num_keyframes < num_before || link_.proposals.Front() == nullptr) {
      if (link_.proposals.Front() != nullptr) {
        ASSERT_TRUE(mapper_.Step());
      }
      const Result<Frame> frame = colon_.source().Next(kNoDeadline);
      ASSERT_TRUE(frame.ok());
      tracker_.Track(*frame, kNoDeadline);
    }
    ASSERT_EQ(link_.proposals.Front()->kind, ProposalKind::kKeyframe);
  }

  ScriptedColon colon_;
  const EngineConfig& config_ = colon_.config();
  WatchedClock clock_;
  SceneRegion scene_;
  TrackingLink link_;
  PlaceMailbox places_;
  Mapper mapper_;
  Tracker tracker_;
};

TEST_F(MappingThread, NewPointsArePublishedBeforeTheyAreAdjusted) {
  RunToProposal(8);
  const std::uint32_t frame = link_.proposals.Front()->view.frame_index;
  LatestMailbox<LocalMap>& snapshots = link_.snapshots;
  snapshots.Refresh();
  const std::uint64_t former = snapshots.ReadSlot().version;
  int num_looks_after = 0;
  clock_.on_look = [&] {
    snapshots.Refresh();
    const LocalMap& map = snapshots.ReadSlot();
    if (map.version == former) return;
    ++num_looks_after;
    EXPECT_EQ(mapper_.atlas().FrameOfKeyframe(map.keyframes[0].id), frame);
    EXPECT_GT(map.num_points, 0);
  };
  ASSERT_TRUE(mapper_.Step());
  // The bundle looks at the clock before every iteration.
  EXPECT_GE(num_looks_after, 2);
}

TEST_F(MappingThread, BundleIsStoppedByAProposalThatWaits) {
  // A pose that is off, and no tracks to put it right before the bundle does: that takes more than the few steps that
  // it is granted in any case.
  colon_.config().mapping.link_neighbours = 0;
  RunToProposal(8);
  link_.proposals.Front()->cam_from_map.translation += Eigen::Vector3d(0.03, 0.02, -0.03);
  const std::uint64_t before = mapper_.counters().num_bundles_stopped;
  int num_looks = 0;
  clock_.on_look = [&] { ++num_looks; };
  link_.num_pending.fetch_add(1);
  ASSERT_TRUE(mapper_.Step());
  link_.num_pending.fetch_sub(1);
  EXPECT_EQ(mapper_.counters().num_bundles_stopped, before + 1);
  const int num_looks_stopped = num_looks;
  RunToProposal(mapper_.counters().num_keyframes);
  link_.proposals.Front()->cam_from_map.translation += Eigen::Vector3d(0.03, 0.02, -0.03);
  num_looks = 0;
  ASSERT_TRUE(mapper_.Step());
  EXPECT_EQ(mapper_.counters().num_bundles_stopped, before + 1) << "nobody waited";
  EXPECT_GT(num_looks, num_looks_stopped);
}

// Nothing is lost for want of room: what cannot be told is not done.
TEST_F(MappingThread, NoStepIsBegunWhileTheRepliesHaveNoRoom) {
  RunToProposal(8);
  while (link_.replies.TryPush({0, FrameNotFound{}})) continue;
  const std::uint64_t before = mapper_.counters().num_keyframes;
  EXPECT_FALSE(mapper_.Step());
  EXPECT_NE(link_.proposals.Front(), nullptr);
  link_.replies.Pop();
  EXPECT_TRUE(mapper_.Step());
  EXPECT_EQ(mapper_.counters().num_keyframes, before + 1);
}

// A second wall is founded when the first map has had all keyframe ids. A map that is not made takes no other's place:
// neither of one that would be kept nor of one that would be dropped.
TEST(MappingFullPools, RefusedMapLeavesTheActiveOneAsItWas) {
  for (const int num_ids : {3, 8}) {
    SCOPED_TRACE(num_ids);
    EngineConfig config = SmallEngineConfig();
    config.memory.max_keyframe_ids = num_ids;
    config.mapping.redundant_share = 1.0;  // none is culled
    config.merging.enabled = false;
    ScriptedColon colon(TimePoint{}, config);
    colon.Move(0.0, 2.0, 60);
    colon.Occlude(5);
    colon.Move(12.0, 14.0, 50);
    colon.Occlude(5);
    colon.Move(0.2, 0.3, 10);
    SceneRegion scene(colon.camera(), {});
    TrackingLink link(config);
    PlaceMailbox places(config, std::pmr::get_default_resource());
    Mapper mapper(config, colon.camera(), scene, colon.device(), link, places, nullptr, false, nullptr);
    Tracker tracker(config, colon.camera(), scene, colon.device(), link, nullptr);
    FrameResult result;
    for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
      result = tracker.Track(*frame, kNoDeadline);
      while (mapper.Step()) continue;
    }
    int num_refused = 0;
    for (MapEvent event; mapper.events().TryPop(&event);) {
      num_refused += event.kind == MapEventKind::kMapRefused;
      EXPECT_NE(event.kind, MapEventKind::kMapStored);
      EXPECT_NE(event.kind, MapEventKind::kMapDropped);
    }
    EXPECT_GT(num_refused, 0);
    EXPECT_GT(mapper.counters().num_keyframe_ids_refused, 0u);
    mapper.atlas().maps().ForEach([](MapHandle, const Map& map) { EXPECT_EQ(map.status, MapStatus::kActive); });
    EXPECT_EQ(mapper.atlas().maps().size(), 1u);
    EXPECT_EQ(mapper.atlas().keyframes().size(), static_cast<std::uint32_t>(num_ids));
    link.snapshots.Refresh();
    EXPECT_EQ(link.snapshots.ReadSlot().map_id, 0u);
    EXPECT_GT(link.snapshots.ReadSlot().num_points, 0);
    EXPECT_EQ(result.state, TrackingState::kTracking) << "it is found again";
  }
}

}  // namespace
}  // namespace haustra::test
