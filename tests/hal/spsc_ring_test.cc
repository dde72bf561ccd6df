#include "hal/core/spsc_ring.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <thread>
#include <vector>

namespace haustra {
namespace {

TEST(SpscRing, GivesBackInOrder) {
  SpscRing<int> ring(3);
  EXPECT_TRUE(ring.TryPush(1));
  EXPECT_TRUE(ring.TryPush(2));
  int value = 0;
  EXPECT_TRUE(ring.TryPop(&value));
  EXPECT_EQ(value, 1);
  EXPECT_TRUE(ring.TryPop(&value));
  EXPECT_EQ(value, 2);
  EXPECT_FALSE(ring.TryPop(&value));
  EXPECT_EQ(value, 2);
}

TEST(SpscRing, PushWhenFullIsRefusedAndCounted) {
  SpscRing<int> ring(2);
  EXPECT_EQ(ring.capacity(), 2u);
  EXPECT_TRUE(ring.TryPush(1));
  EXPECT_TRUE(ring.TryPush(2));
  EXPECT_FALSE(ring.TryPush(3));
  EXPECT_EQ(ring.BeginPush(), nullptr);
  EXPECT_EQ(ring.num_dropped(), 2u);
  EXPECT_EQ(ring.size(), 2u);
}

TEST(SpscRing, SizeIsRightAcrossTheWrap) {
  SpscRing<int> ring(3);
  int value = 0;
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(ring.TryPush(i));
    EXPECT_TRUE(ring.TryPush(100 + i));
    EXPECT_EQ(ring.size(), 2u);
    EXPECT_TRUE(ring.TryPop(&value));
    EXPECT_EQ(value, i);
    EXPECT_TRUE(ring.TryPop(&value));
    EXPECT_TRUE(ring.is_empty());
  }
}

TEST(SpscRing, NothingIsVisibleBeforeCommit) {
  SpscRing<int> ring(2);
  *ring.BeginPush() = 5;
  EXPECT_TRUE(ring.is_empty());
  EXPECT_EQ(ring.Front(), nullptr);
  ring.CommitPush();
  ASSERT_NE(ring.Front(), nullptr);
  EXPECT_EQ(*ring.Front(), 5);
  ring.Pop();
  EXPECT_EQ(ring.Front(), nullptr);
}

TEST(SpscRing, SlotsFilledInPlaceKeepTheirMemory) {
  SpscRing<std::vector<int>> ring(2, std::vector<int>(100));
  std::vector<const int*> memory;
  for (int i = 0; i < 9; ++i) {
    std::vector<int>* slot = ring.BeginPush();
    ASSERT_NE(slot, nullptr);
    ASSERT_EQ(slot->size(), 100u);
    if (i < 3) {
      memory.push_back(slot->data());
    } else {
      EXPECT_EQ(slot->data(), memory[i % 3]);
    }
    ring.CommitPush();
    ring.Pop();
  }
}

TEST(SpscRing, TwoThreadsLoseAndReorderNothing) {
  constexpr std::uint64_t kCount = 200000;
  // A wide element: a torn one would show as a wrong sum.
  using Element = std::array<std::uint64_t, 8>;
  SpscRing<Element> ring(7);
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kCount;) {
      if (Element* slot = ring.BeginPush(); slot != nullptr) {
        slot->fill(i++);
        ring.CommitPush();
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t num_wrong = 0;
  for (std::uint64_t expected = 0; expected < kCount;) {
    if (const Element* front = ring.Front(); front != nullptr) {
      for (const std::uint64_t value : *front) num_wrong += value != expected ? 1 : 0;
      ring.Pop();
      ++expected;
    } else {
      std::this_thread::yield();
    }
  }
  producer.join();
  EXPECT_EQ(num_wrong, 0u);
  EXPECT_TRUE(ring.is_empty());
}

}  // namespace
}  // namespace haustra
