// What is told of a join: one event, whatever became of it. The answer of the recogniser is that of geometry.
#include "engine/mapping/joiner.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/place/make_retrieval.h"
#include "tests/engine/merging/known_join.h"
#include "tests/hal/ticking_clock.h"

namespace haustra::test {
namespace {

constexpr std::uint32_t kFrame = 77;

// A joiner in real-time mode, for which a millisecond goes by whenever it looks at the clock.
class JoinerTest : public testing::Test {
 protected:
  JoinerTest() : join_(5, 100) {}

  void MakeParts() {
    const EngineConfig& config = join_.colon.config();
    link_.emplace(config);
    places_.emplace(config, std::pmr::get_default_resource());
    scene_.emplace(join_.colon.camera(), ImageView{});
    state_.emplace(config, join_.colon.camera(), *scene_, join_.colon.device(), *link_, &clock_, true,
                   std::pmr::get_default_resource());
    publisher_.emplace(*state_, *places_);
    retrieval_ = MakeRetrieval(config, join_.colon.device(), nullptr);
    trial_.emplace(config.mapping);
    bundle_.emplace(config, state_->noise, join_.colon.camera(), adjuster_);
    events_.emplace(8);
    joiner_.emplace(*state_, Joiner::Parts{*places_, *publisher_, *retrieval_, *trial_, *bundle_, adjuster_, *events_});
    state_->atlas = join_.atlas;
    state_->newest = join_.plan.keyframe_a;
    state_->active = state_->atlas.keyframe(state_->newest).map;
  }

  // The recogniser says yes; the first slice of what follows.
  void BeginJoin(int max_milliseconds, bool is_turned_meanwhile = false) {
    join_.colon.config().merging.max_milliseconds = max_milliseconds;
    MakeParts();
    PlaceTask* task = places_->Free();
    task->stage = PlaceTask::Stage::kVerify;
    task->frame_index = kFrame;
    task->is_known = true;
    const MergePlan& plan = join_.plan;
    task->area = {Counts(), plan.keyframe_a, plan.keyframe_b, plan.anchor_a, plan.anchor_b, plan.b_from_a,
                  1.0,      plan.points};
    places_->Ask();
    if (is_turned_meanwhile) ++state_->counters.num_reliefs_turned;
    places_->Answer();
    EXPECT_TRUE(joiner_->TakeAnswer());
  }
  // All other slices. What was told of it.
  std::vector<MapEvent> EndJoin() {
    while (joiner_->is_joining()) joiner_->GoOn();
    EXPECT_FALSE(places_->is_out()) << "the next question may be asked";
    EXPECT_FALSE(state_->is_seam_open);
    EXPECT_EQ(CheckInvariants(state_->atlas).ToString(), "ok");
    std::vector<MapEvent> events;
    for (MapEvent event; events_->TryPop(&event);) events.push_back(event);
    return events;
  }
  std::vector<MapEvent> Join(int max_milliseconds) {
    BeginJoin(max_milliseconds);
    return EndJoin();
  }
  // Tracking is found elsewhere.
  void GoTo(KeyframeHandle keyframe) {
    state_->newest = keyframe;
    state_->active = state_->atlas.keyframe(keyframe).map;
  }
  CommonAreaCounts Counts() const {
    const Keyframe &a = join_.atlas.keyframe(join_.plan.keyframe_a), &b = join_.atlas.keyframe(join_.plan.keyframe_b);
    CommonAreaCounts counts;
    counts.verdict = CommonAreaVerdict::kAccepted;
    counts.keyframe_a = a.id;
    counts.keyframe_b = b.id;
    counts.map_a = join_.atlas.map(a.map).id;
    counts.map_b = join_.atlas.map(b.map).id;
    counts.num_inliers = static_cast<int>(join_.plan.points.size());
    return counts;
  }

  // One event that says why, with what had been measured; a map that nobody moved, and nothing of it to the tracker.
  void ExpectNotJoined(const std::vector<MapEvent>& events, CommonAreaVerdict why = CommonAreaVerdict::kNotJoined) {
    ASSERT_EQ(events.size(), 1u);
    EXPECT_EQ(events[0].kind, MapEventKind::kMergeRejected) << ToString(events[0].kind);
    EXPECT_EQ(ToString(events[0].place.verdict), ToString(why));
    EXPECT_EQ(events[0].frame_index, kFrame);
    EXPECT_EQ(events[0].map_id, Counts().map_a);
    EXPECT_EQ(events[0].other_map_id, Counts().map_b);
    EXPECT_EQ(events[0].place.keyframe_a, Counts().keyframe_a);
    EXPECT_EQ(events[0].place.keyframe_b, Counts().keyframe_b);
    EXPECT_EQ(events[0].place.num_inliers, Counts().num_inliers);
    const bool is_outdated = why == CommonAreaVerdict::kOutdated;
    EXPECT_EQ(state_->counters.num_loops_left_open, is_outdated ? 0u : 1u);
    EXPECT_EQ(state_->counters.num_merges_outdated, is_outdated ? 1u : 0u);
    EXPECT_TRUE(link_->replies.is_empty());
    join_.atlas.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& keyframe) {
      ASSERT_EQ(state_->atlas.keyframe(handle).cam_from_map.translation, keyframe.cam_from_map.translation);
      ASSERT_EQ(state_->atlas.keyframe(handle).map, keyframe.map);
    });
  }

  // More and more time, until it is joined. Returns how often it was not.
  int JoinInTheEnd(MapEventKind kind, MapId other_map) {
    for (int num_refused = 0; num_refused < 200; ++num_refused) {
      const int max_milliseconds = 1 + 10 * num_refused;
      SCOPED_TRACE(max_milliseconds);
      const std::vector<MapEvent> events = Join(max_milliseconds);
      if (state_->counters.num_reframings == 0) {
        ExpectNotJoined(events);
        if (HasFailure()) return num_refused;
        continue;
      }
      EXPECT_EQ(events.size(), 1u);
      EXPECT_EQ(events[0].kind, kind) << ToString(events[0].kind);
      EXPECT_EQ(events[0].place.verdict, CommonAreaVerdict::kAccepted);
      EXPECT_EQ(events[0].frame_index, kFrame);
      EXPECT_EQ(events[0].other_map_id, other_map);
      EXPECT_EQ(state_->counters.num_loops_left_open, 0u);
      return num_refused;
    }
    ADD_FAILURE() << "never joined";
    return 0;
  }

  KnownJoin join_;
  TickingClock clock_;
  SchurBundleAdjuster adjuster_;
  std::optional<TrackingLink> link_;
  std::optional<SceneRegion> scene_;
  std::optional<PlaceMailbox> places_;
  std::optional<MappingState> state_;
  std::optional<SnapshotPublisher> publisher_;
  std::unique_ptr<KeyframeRetrieval> retrieval_;
  std::optional<PointTrial> trial_;
  std::optional<LocalBundle> bundle_;
  std::optional<SpscRing<MapEvent>> events_;
  std::optional<Joiner> joiner_;
};

TEST_F(JoinerTest, LoopThatHadNoTimeIsToldAsNotJoinedAndNeverAsClosed) {
  MakeLoop(LoopShape{.num_keyframes = 40}, &join_);
  EXPECT_GE(JoinInTheEnd(MapEventKind::kLoopClosed, kNoId), 3);
}

TEST_F(JoinerTest, MergeThatHadNoTimeIsToldAsNotJoinedAndNeverAsMerged) {
  const Sim3 moved(0.6, ExpSO3({-0.2, 0.7, 1.1}), {1.0, 3.0, -2.0});
  MakeTwoMaps(12, 10, 0.2, Sim3{}, moved, &join_);
  EXPECT_GE(JoinInTheEnd(MapEventKind::kMerged, Counts().map_a), 1);
}

// All keyframes stand at the seam, and none of the side that moves is held by it.
TEST_F(JoinerTest, LoopOfNothingButItsEndsIsClosed) {
  MakeLoop(LoopShape{.num_keyframes = 4}, &join_);
  const std::vector<MapEvent> events = Join(10000);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].kind, MapEventKind::kLoopClosed) << ToString(events[0].kind);
}

TEST_F(JoinerTest, JoinWhoseMapTrackingLeavesBeforeTheFirstMoveIsToldAsOutdated) {
  MakeTwoMaps(12, 10, 0.2, Sim3{}, Sim3{}, &join_);
  join_.colon.config().merging.slice_milliseconds = 1;
  BeginJoin(10000);
  ASSERT_TRUE(joiner_->is_joining());
  ASSERT_EQ(state_->counters.num_reframings, 0u);
  GoTo(join_.plan.keyframe_b);
  ExpectNotJoined(EndJoin(), CommonAreaVerdict::kOutdated);
}

// The plan, and the graph that was captured for it, are of its former shape.
TEST_F(JoinerTest, JoinWhoseMapIsBuiltAnewBeforeTheFirstMoveIsToldAsOutdated) {
  MakeTwoMaps(12, 10, 0.2, Sim3{}, Sim3{}, &join_);
  join_.colon.config().merging.slice_milliseconds = 1;
  BeginJoin(10000);
  ASSERT_TRUE(joiner_->is_joining());
  ++state_->counters.num_reliefs_turned;
  ExpectNotJoined(EndJoin(), CommonAreaVerdict::kOutdated);
}

TEST_F(JoinerTest, AnswerAboutAMapThatWasBuiltAnewMeanwhileIsOutdated) {
  MakeTwoMaps(12, 10, 0.2, Sim3{}, Sim3{}, &join_);
  BeginJoin(10000, true);
  EXPECT_FALSE(joiner_->is_joining());
  ExpectNotJoined(EndJoin(), CommonAreaVerdict::kOutdated);
}

TEST_F(JoinerTest, SettlingEndsWhenTrackingIsInAnotherMap) {
  MakeLoop(LoopShape{.num_keyframes = 40}, &join_);
  const int elsewhere = join_.colon.AddMap(&join_.atlas, 0.0, 1.0, 6, Sim3{}).first + 5;
  ASSERT_EQ(Join(10000).size(), 1u);
  ASSERT_EQ(state_->counters.num_reframings, 2u);
  ASSERT_TRUE(joiner_->SettleSeam()) << "nothing is left to settle: the test shows nothing";
  const std::uint64_t num_told = state_->counters.num_reframings;
  GoTo(join_.frame(elsewhere).keyframe);
  EXPECT_FALSE(joiner_->SettleSeam());
  EXPECT_EQ(state_->counters.num_reframings, num_told);
  GoTo(join_.plan.keyframe_a);
  EXPECT_FALSE(joiner_->SettleSeam()) << "it has ended";
}

}  // namespace
}  // namespace haustra::test
