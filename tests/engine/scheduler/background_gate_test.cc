// The gap rule on a clock that the test moves: sleeping at the gate runs the script of the tracking side.
#include "engine/scheduler/background_gate.h"

#include <gtest/gtest.h>

#include <functional>
#include <iterator>
#include <map>

#include "engine/scheduler/gated_vision_device.h"
#include "hal/fakes/manual_clock.h"
#include "hal/fakes/scripted_vision_device.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

// Frames at 0, 40, 80 ms, each tracked for `busy`; the script runs as the clock moves.
class TrackingThread {
 public:
  explicit TrackingThread(Duration busy) : gate_(clock_, 0.98, &TrackingThread::Sleep, this) {
    for (int i = 0; i < 10; ++i) {
      const TimePoint due(i * milliseconds(40));
      script_.emplace(due, [this] { gate_.FrameBegins(); });
      script_.emplace(due + busy, [this, due] { gate_.FrameEnds(due + milliseconds(40)); });
    }
  }

  void AdvanceTo(TimePoint time) {
    while (!script_.empty() && script_.begin()->first <= time) {
      clock_.AdvanceTo(script_.begin()->first);
      script_.begin()->second();
      script_.erase(script_.begin());
    }
    clock_.AdvanceTo(time);
  }
  // When a request that comes at `ms` may go.
  double EnterAt(int ms) {
    AdvanceTo(TimePoint(milliseconds(ms)));
    gate_.Enter();
    return ToMilliseconds(clock_.Now().time_since_epoch());
  }
  void EndsAfter(std::size_t num_events) {
    while (script_.size() > num_events) script_.erase(std::prev(script_.end()));
  }

  BackgroundGate& gate() { return gate_; }
  const ManualClock& clock() const { return clock_; }

 private:
  static void Sleep(void* self, Duration duration) {
    auto& tracking = *static_cast<TrackingThread*>(self);
    tracking.AdvanceTo(tracking.clock_.Now() + duration);
  }

  ManualClock clock_;
  BackgroundGate gate_;
  std::multimap<TimePoint, std::function<void()>> script_;
};

TEST(BackgroundGate, RequestThatFitsIntoTheGapGoesAtOnce) {
  TrackingThread tracking(milliseconds(15));
  tracking.gate().Leave(milliseconds(5));
  EXPECT_EQ(tracking.EnterAt(20), 20);
  EXPECT_EQ(tracking.EnterAt(35), 35);
  EXPECT_EQ(tracking.gate().num_waits(), 0u);
}

TEST(BackgroundGate, RequestNearTheNextFrameWaitsUntilItIsAnswered) {
  TrackingThread tracking(milliseconds(15));
  tracking.gate().Leave(milliseconds(5));
  const double entered = tracking.EnterAt(36);
  EXPECT_GE(entered, 55);
  EXPECT_LT(entered, 56);
  EXPECT_EQ(tracking.gate().num_waits(), 1u);
  EXPECT_GE(tracking.gate().waited(), milliseconds(19));
}

TEST(BackgroundGate, RequestDuringAFrameWaitsUntilItIsAnswered) {
  TrackingThread tracking(milliseconds(15));
  EXPECT_GE(tracking.EnterAt(45), 55);
}

TEST(BackgroundGate, LongRequestGoesRightAfterAFrame) {
  TrackingThread tracking(milliseconds(15));
  for (int i = 0; i < 3; ++i) tracking.gate().Leave(milliseconds(60));  // fits into no gap
  const double entered = tracking.EnterAt(20);
  EXPECT_GE(entered, 55);
  EXPECT_LT(entered, 56);
}

TEST(BackgroundGate, TrackingWithoutAPauseStopsNothing) {
  TrackingThread tracking(milliseconds(40));  // ends when the next begins
  const double entered = tracking.EnterAt(50);
  EXPECT_LE(entered, 125);
}

TEST(BackgroundGate, FrameThatNeverComesIsNotWaitedForForEver) {
  TrackingThread tracking(milliseconds(15));
  tracking.EndsAfter(2);
  tracking.gate().Leave(milliseconds(5));
  const double entered = tracking.EnterAt(38);
  EXPECT_GE(entered, 140);
  EXPECT_LT(entered, 141);
  EXPECT_EQ(tracking.EnterAt(500), 500);
}

// A checkpoint reads set by set: between two of them a frame is let through.
TEST(GatedVisionDevice, CopiesOfDescriptorsKeepOutOfTheFrame) {
  TrackingThread tracking(milliseconds(10));
  VisionPlan plan;
  plan.max_feature_sets = 1;
  ScriptedVisionDevice inner(plan, {});
  GatedVisionDevice device(inner, tracking.gate(), tracking.clock());
  const FeatureSetHandle set = device.CreateFeatureSet().value();
  for (const int ms : {42, 83}) {  // in the middle of the second frame and of the third
    tracking.AdvanceTo(TimePoint(milliseconds(ms)));
    EXPECT_TRUE(device.ReadDescriptors(set, {}).ok());
  }
  EXPECT_EQ(tracking.gate().num_waits(), 2u);
}

TEST(BackgroundGate, BeforeTheFirstFrameIsOpen) {
  ManualClock clock;
  BackgroundGate gate(clock, 0.98);
  gate.Enter();
  EXPECT_EQ(gate.num_waits(), 0u);
}

}  // namespace
}  // namespace haustra
