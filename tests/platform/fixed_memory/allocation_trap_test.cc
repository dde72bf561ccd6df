// That the trap catches what it should, and that tracking gives it nothing to catch.
#include "platform/trap/allocation_trap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <thread>

#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

// Through a volatile pointer, so that the compiler cannot leave out what is never used.
void* volatile block = nullptr;

TEST(AllocationTrap, CountsEveryCallOfTheFamilyOnItsThread) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  const AllocationTrap trap(AllocationTrap::Mode::kCount);
  EXPECT_EQ(trap.count(), 0u);
  block = std::malloc(10);
  block = std::realloc(block, 1000);
  std::free(block);
  EXPECT_EQ(trap.count(), 3u);
  block = std::calloc(2, 8);
  std::free(block);
  block = std::aligned_alloc(64, 128);
  std::free(block);
  EXPECT_EQ(trap.count(), 7u);
  block = ::operator new(16);
  ::operator delete(block);
  EXPECT_EQ(trap.count(), 9u);
  std::free(nullptr);
  EXPECT_EQ(trap.count(), 9u);
}

TEST(AllocationTrap, OtherThreadsAndTheTimeAfterAreFree) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  std::atomic<int> stage{0};
  std::thread other([&] {
    while (stage.load() == 0) std::this_thread::yield();
    void* volatile mine = std::malloc(100);
    std::free(mine);
    stage = 2;
  });
  {
    const AllocationTrap outer(AllocationTrap::Mode::kAbort);
    stage = 1;
    while (stage.load() != 2) std::this_thread::yield();
    {
      const AllocationTrap inner(AllocationTrap::Mode::kCount);
      block = std::malloc(1);
      std::free(block);
      EXPECT_EQ(inner.count(), 2u);
    }
    EXPECT_EQ(outer.count(), 0u);
  }
  other.join();
  block = std::malloc(1);
  std::free(block);
}

TEST(AllocationTrapDeathTest, AbortNamesTheCall) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto allocate = [] {
    const AllocationTrap trap(AllocationTrap::Mode::kAbort);
    block = std::malloc(10);
  };
  EXPECT_DEATH(allocate(), "allocation trap: malloc on a thread that must not use the heap");
  const auto give_back = [] {
    block = std::malloc(10);
    const AllocationTrap trap(AllocationTrap::Mode::kAbort);
    std::free(block);
  };
  EXPECT_DEATH(give_back(), "allocation trap: free on a thread");
}

// Losses, relocalisations, new maps and merges, and an end in the dark.
void ManyLosses(test::ScriptedColon* colon) {
  colon->Move(0.0, 2.0, 55);
  colon->Occlude(6);
  colon->Move(1.9, 2.5, 20);
  colon->Occlude(6);
  colon->Move(7.0, 8.0, 35);
  colon->Occlude(6);
  colon->Move(2.4, 8.2, 125);
  colon->Occlude(3);
}

class Watched final : public test::RecordingObserver {
 public:
  explicit Watched(const ThreadWatch& watch) : watch_(watch) {}
  const ThreadWatch* thread_watch() const override { return &watch_; }

 private:
  const ThreadWatch& watch_;
};

TEST(AllocationTrap, TrackingThroughLossesAndMergesLeavesTheHeapAlone) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  for (const bool is_realtime : {false, true}) {
    test::ScriptedColon colon;
    ManyLosses(&colon);
    const auto engine =
        colon.MakeEngine(is_realtime ? Engine::Mode::kRealTime : Engine::Mode::kSequential, colon.device());
    Watched observer(CountingHeapWatch());
    const SystemClock clock;
    const std::atomic<bool> never{false};
    const auto session = is_realtime ? RunRealTime(colon.source(), *engine, clock, 50.0, observer, never)
                                     : RunSequential(colon.source(), *engine, clock, observer, never);
    ASSERT_TRUE(session.ok());
    int num_tracked = 0;
    for (const FrameOutcome& frame : observer.frames) {
      EXPECT_EQ(frame.use.trapped_calls, 0u)
          << "frame " << frame.result.frame_index << ' ' << ToString(frame.result.reason);
      num_tracked += frame.result.state == TrackingState::kTracking;
    }
    if (is_realtime) continue;
    EXPECT_GT(num_tracked, 150);
    const auto count = [&](MapEventKind kind) {
      return std::count_if(observer.events.begin(), observer.events.end(),
                           [kind](const MapEvent& event) { return event.kind == kind; });
    };
    EXPECT_GE(count(MapEventKind::kMapCreated), 2);
    EXPECT_GE(count(MapEventKind::kMerged), 1);
  }
}

}  // namespace
}  // namespace haustra
