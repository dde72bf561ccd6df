#include "hal/core/slot_pool.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <vector>

#include "tests/hal/fatal_trap.h"

namespace haustra {
namespace {

struct TestTag;
using Pool = SlotPool<int, TestTag>;
using TestHandle = Handle<TestTag>;

TEST(Handle, DefaultIsInvalid) {
  const TestHandle handle;
  EXPECT_FALSE(handle.is_valid());
  EXPECT_FALSE(handle);
}

TEST(Handle, GenerationsMakeHandlesDiffer) {
  const TestHandle first{3, 0}, second{3, 1};
  EXPECT_NE(first, second);
  EXPECT_EQ(first, (TestHandle{3, 0}));
  EXPECT_LT(first, second);
}

TEST(SlotPool, NewPoolIsEmpty) {
  const Pool pool(4);
  EXPECT_EQ(pool.size(), 0u);
  EXPECT_EQ(pool.capacity(), 4u);
  EXPECT_EQ(pool.Get(TestHandle{0, 0}), nullptr);
  EXPECT_EQ(pool.Get(TestHandle{}), nullptr);
}

TEST(SlotPool, InsertWhenFullGivesAnInvalidHandleAndCountsIt) {
  Pool pool(2);
  EXPECT_TRUE(pool.Insert());
  EXPECT_TRUE(pool.Insert());
  EXPECT_FALSE(pool.Insert());
  EXPECT_FALSE(pool.Insert());
  EXPECT_EQ(pool.size(), 2u);
  EXPECT_EQ(pool.num_refused(), 2u);
}

TEST(SlotPool, PoolWithoutSlotsRefusesEverything) {
  Pool pool(0);
  EXPECT_FALSE(pool.Insert());
  EXPECT_EQ(pool.num_refused(), 1u);
}

TEST(SlotPool, StaleHandleFindsNothingAfterTheSlotIsUsedAgain) {
  Pool pool(1);
  const TestHandle first = pool.Insert();
  pool.At(first) = 11;
  EXPECT_TRUE(pool.Release(first));
  EXPECT_EQ(pool.Get(first), nullptr);
  const TestHandle second = pool.Insert();
  pool.At(second) = 22;
  EXPECT_EQ(second.index, first.index);
  EXPECT_EQ(pool.Get(first), nullptr);
  EXPECT_FALSE(pool.Contains(first));
  EXPECT_EQ(*pool.Get(second), 22);
}

TEST(SlotPool, SecondReleaseIsRefused) {
  Pool pool(2);
  const TestHandle handle = pool.Insert();
  EXPECT_TRUE(pool.Release(handle));
  EXPECT_FALSE(pool.Release(handle));
  EXPECT_FALSE(pool.Release(TestHandle{}));
  EXPECT_FALSE(pool.Release(TestHandle{1, 0}));
  EXPECT_EQ(pool.size(), 0u);
}

TEST(SlotPool, StaleAccessIsAProgrammerError) {
  const FatalTrap trap;
  Pool pool(1);
  const TestHandle handle = pool.Insert();
  pool.Release(handle);
  EXPECT_THROW(pool.At(handle), CheckFailure);
}

TEST(SlotPool, LowestFreeSlotIsHandedOutFirst) {
  Pool pool(4);
  std::vector<TestHandle> handles;
  for (int i = 0; i < 4; ++i) handles.push_back(pool.Insert());
  pool.Release(handles[3]);
  pool.Release(handles[1]);
  pool.Release(handles[2]);
  EXPECT_EQ(pool.Insert().index, 1u);
  EXPECT_EQ(pool.Insert().index, 2u);
  EXPECT_EQ(pool.Insert().index, 3u);
}

TEST(SlotPool, HighWaterMarkStays) {
  Pool pool(8);
  std::vector<TestHandle> handles;
  for (int i = 0; i < 5; ++i) handles.push_back(pool.Insert());
  for (const TestHandle handle : handles) pool.Release(handle);
  pool.Insert();
  EXPECT_EQ(pool.high_water(), 5u);
  EXPECT_EQ(pool.size(), 1u);
}

TEST(SlotPool, ForEachGoesInSlotOrderAndMayReleaseWhatItIsGiven) {
  Pool pool(5);
  for (int i = 0; i < 5; ++i) pool.At(pool.Insert()) = i;
  std::vector<int> visited;
  pool.ForEach([&](TestHandle handle, int& value) {
    visited.push_back(value);
    if (value % 2 == 0) pool.Release(handle);
  });
  EXPECT_EQ(visited, (std::vector<int>{0, 1, 2, 3, 4}));
  visited.clear();
  pool.ForEach([&](TestHandle, int& value) { visited.push_back(value); });
  EXPECT_EQ(visited, (std::vector<int>{1, 3}));
}

TEST(SlotPool, BehavesLikeAMapUnderRandomUse) {
  constexpr std::uint32_t kCapacity = 32;
  Pool pool(kCapacity);
  std::map<TestHandle, int> model;
  std::vector<TestHandle> released;
  std::mt19937 rng(17);
  for (int step = 0; step < 20000; ++step) {
    if (rng() % 2 == 0) {
      const TestHandle handle = pool.Insert();
      EXPECT_EQ(handle.is_valid(), model.size() < kCapacity);
      if (handle) {
        pool.At(handle) = step;
        EXPECT_TRUE(model.emplace(handle, step).second) << "a handle came twice";
      }
    } else if (!model.empty()) {
      auto chosen = model.begin();
      std::advance(chosen, rng() % model.size());
      EXPECT_TRUE(pool.Release(chosen->first));
      released.push_back(chosen->first);
      model.erase(chosen);
    }
    ASSERT_EQ(pool.size(), model.size());
    if (!released.empty()) {
      ASSERT_EQ(pool.Get(released[rng() % released.size()]), nullptr);
    }
  }
  for (const auto& [handle, value] : model) EXPECT_EQ(*pool.Get(handle), value);
}

}  // namespace
}  // namespace haustra
