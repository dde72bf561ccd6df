// What becomes of the feature set of a keyframe that the mapper has no room for.
#include <memory>

#include "hal/fakes/manual_clock.h"
#include "tests/engine/tracking/tracker_with_mapper.h"

namespace haustra::test {
namespace {

constexpr Duration kSearchTime = std::chrono::milliseconds(2);

struct FrameClock {
  ManualClock clock;
};

// Searches take time; what has a deadline ends 40 ms after it began.
class RefusedKeyframeTest : private FrameClock, public TrackerWithMapper {
 protected:
  RefusedKeyframeTest() : TrackerWithMapper(FewIds(), &clock) {
    device_.on_search = [this] { clock.Advance(kSearchTime); };
  }
  static EngineConfig FewIds() {
    EngineConfig config = SmallEngineConfig();
    config.memory.max_keyframe_ids = 4;
    return config;
  }

  TimePoint Deadline() const { return clock.Now() + kFramePeriod; }
  // The set of the frame, which tracking goes on from.
  FeatureSetHandle TrackUntilRefused() {
    for (int i = 0; i < 80; ++i) {
      const FrameResult result = TrackNext(Deadline());
      const FeatureSetHandle set = result.is_keyframe ? link_.proposals.Front()->view.features.set : FeatureSetHandle{};
      Map();
      if (mapper_.counters().num_keyframes_refused > 0) return set;
    }
    ADD_FAILURE() << "no keyframe was refused";
    return {};
  }
  // As after a settled seam or a mark that was set: all that was retired before may go once it is used.
  void PublishAgain() {
    link_.snapshots.Refresh();
    const auto next = std::make_unique<LocalMap>(link_.snapshots.ReadSlot());
    ++next->version;
    link_.snapshots.WriteSlot() = *next;
    link_.snapshots.Publish();
  }
  // Its first search fails, and the time left is too short for another one.
  FrameResult TrackWithoutTime() {
    const TimePoint deadline = Deadline();
    const Duration reserve(static_cast<std::int64_t>(1e6 * config_.scheduler.reserve_ms));
    device_.on_search = [=, this] { clock.AdvanceTo(deadline - reserve - kSearchTime / 4); };
    device_.finds = false;
    const FrameResult result = TrackNext(deadline);
    device_.on_search = [this] { clock.Advance(kSearchTime); };
    return result;
  }
  bool IsInUse(FeatureSetHandle set) {
    if (!device_.RetainFeatureSet(set)) return false;
    device_.ReleaseFeatureSet(set);
    return true;
  }
};

TEST_F(RefusedKeyframeTest, GoesWithItsFrameThoughNothingIsPublished) {
  const FeatureSetHandle set = TrackUntilRefused();
  ASSERT_TRUE(IsInUse(set)) << "the last frame's";
  ASSERT_EQ(TrackNext(Deadline()).state, TrackingState::kTracking);
  Map();
  EXPECT_FALSE(IsInUse(set));
}

TEST_F(RefusedKeyframeTest, TrackingGoesOnFromItAfterAFrameWithoutTime) {
  const FeatureSetHandle set = TrackUntilRefused();
  PublishAgain();
  ASSERT_EQ(TrackWithoutTime().reason, TrackingReason::kPredicted);
  Map();
  EXPECT_TRUE(IsInUse(set));
  EXPECT_EQ(TrackNext(Deadline()).reason, TrackingReason::kTracked);
  Map();
  EXPECT_FALSE(IsInUse(set));
}

}  // namespace
}  // namespace haustra::test
