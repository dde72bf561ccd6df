#include "kernels/common/feature_set_slots.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>
#include <vector>

#include "platform/trap/wait_trap.h"

namespace haustra::kernels {
namespace {

TEST(FeatureSetSlots, LowestFreeSlotIsHandedOutAlsoBeyondAWord) {
  FeatureSetSlots slots(130);
  std::vector<FeatureSetHandle> handles;
  for (std::uint32_t i = 0; i < 130; ++i) {
    handles.push_back(slots.Create());
    EXPECT_EQ(handles.back().index, i);
  }
  EXPECT_EQ(slots.num_free(), 0);
  EXPECT_FALSE(slots.Create().is_valid());
  slots.Release(handles[129]);
  slots.Release(handles[70]);
  EXPECT_EQ(slots.num_free(), 2);
  const FeatureSetHandle again = slots.Create();
  EXPECT_EQ(again.index, 70u);
  EXPECT_NE(again.generation, handles[70].generation);
  EXPECT_EQ(slots.NumFeatures(handles[70]), -1);
  EXPECT_EQ(slots.NumFeatures(again), 0);
  EXPECT_EQ(slots.Create().index, 129u);
}

TEST(FeatureSetSlots, OwnersComeAndGoWhileASetIsWritten) {
  FeatureSetSlots slots(2);
  const FeatureSetHandle set = slots.Create();
  EXPECT_EQ(slots.BeginWrite(set), FeatureSetSlots::WriteClaim::kGranted);
  EXPECT_TRUE(slots.Retain(set));
  EXPECT_EQ(slots.BeginWrite(set), FeatureSetSlots::WriteClaim::kWrittenBefore);
  slots.Release(set);
  slots.Publish(set, 7);
  EXPECT_EQ(slots.NumFeatures(set), 7);
  EXPECT_TRUE(slots.Retain(set));
  slots.Release(set);
  EXPECT_EQ(slots.NumFeatures(set), 7);
  slots.Release(set);
  EXPECT_EQ(slots.NumFeatures(set), -1);
  EXPECT_FALSE(slots.Retain(set));
  slots.Release(set);
  EXPECT_EQ(slots.num_free(), 2);
  EXPECT_EQ(slots.BeginWrite(set), FeatureSetSlots::WriteClaim::kStale);
}

// No set has two makers at a time, whoever else comes and goes.
TEST(FeatureSetSlots, ThreadsNeverHoldOneSetTwice) {
  constexpr int kNumSlots = 8, kNumThreads = 4, kNumTurns = 20000;
  FeatureSetSlots slots(kNumSlots);
  std::array<std::atomic<int>, kNumSlots> holders{};
  std::atomic<int> num_clashes{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kNumThreads; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < kNumTurns; ++i) {
        const FeatureSetHandle set = slots.Create();
        if (!set.is_valid()) continue;
        num_clashes += holders[set.index].fetch_add(1) != 0;
        num_clashes += slots.BeginWrite(set) != FeatureSetSlots::WriteClaim::kGranted;
        num_clashes += !slots.Retain(set);
        slots.Publish(set, i);
        slots.Release(set);
        num_clashes += slots.NumFeatures(set) != i;
        holders[set.index].fetch_sub(1);
        slots.Release(set);
        num_clashes += slots.NumFeatures(set) != -1;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_clashes, 0);
  EXPECT_EQ(slots.num_free(), kNumSlots);
}

TEST(FeatureSetSlots, NobodyIsWaitedFor) {
  if (!WaitTrap::CatchesLocks()) GTEST_SKIP() << "locks cannot be watched in this build";
  FeatureSetSlots slots(4);
  const std::uint32_t before = WaitTrap::num_locks();
  {
    const WaitTrap trap(WaitTrap::Mode::kCount);
    const FeatureSetHandle set = slots.Create();
    EXPECT_TRUE(slots.Retain(set));
    slots.Release(set);
    slots.Release(set);
    EXPECT_EQ(slots.num_free(), 4);
  }
  EXPECT_EQ(WaitTrap::num_locks(), before);
}

}  // namespace
}  // namespace haustra::kernels
