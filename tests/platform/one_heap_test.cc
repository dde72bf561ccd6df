// Seen from the C library's own figures: how large the heap is, and how many blocks are mapped beside it.
#include "platform/realtime/one_heap.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <thread>

#include "tests/sanitized.h"

namespace haustra {
namespace {

constexpr std::size_t kMegabyte = std::size_t{1} << 20;

void TakeAndFree(std::size_t num_bytes) {
  void* volatile block = std::malloc(num_bytes);
  EXPECT_NE(block, nullptr);
  std::free(block);
}

// An emulator may leave the heap little room to grow in one piece; glibc then takes it elsewhere and cannot give it
// back.
bool HasRoomToGrow() {
  constexpr std::intptr_t kRoom = 512 * static_cast<std::intptr_t>(kMegabyte);
  if (::sbrk(kRoom) == reinterpret_cast<void*>(-1)) return false;
  ::sbrk(-kRoom);
  return true;
}

class OneHeap : public ::testing::Test {
 protected:
  void SetUp() override {
    if (test::kIsSanitized) GTEST_SKIP() << "the sanitizer's heap is not the one that is meant";
    if (!HasRoomToGrow()) GTEST_SKIP() << "this process's heap cannot grow in one piece";
    UseOneHeap();
  }
};

TEST_F(OneHeap, WhatWasSetAsideSufficesAfterwards) {
  ASSERT_TRUE(HoldHeap(100 * kMegabyte));
  const std::size_t before = HeapBytes();
  EXPECT_GE(before, 100 * kMegabyte);
  for (const std::size_t size : {100 * kMegabyte, 40 * kMegabyte, kMegabyte, std::size_t{100}}) TakeAndFree(size);
  EXPECT_EQ(HeapBytes(), before) << "neither larger nor given back";
  TakeAndFree(200 * kMegabyte);
  EXPECT_GE(HeapBytes(), before + 90 * kMegabyte);
  ReleaseHeap();
  EXPECT_LE(HeapBytes(), before - 50 * kMegabyte);
}

bool OtherThreadsUseTheHeapThatIsHeld() {
  UseOneHeap();
  if (!HoldHeap(20 * kMegabyte)) return false;
  const struct mallinfo2 before = ::mallinfo2();
  std::size_t in_use = 0;
  std::thread([&in_use] {
    void* volatile block = std::malloc(10 * kMegabyte);
    in_use = ::mallinfo2().uordblks;
    std::free(block);
  }).join();
  EXPECT_GE(in_use, before.uordblks + 10 * kMegabyte);
  EXPECT_EQ(::mallinfo2().hblks, before.hblks) << "mapped by themselves";
  EXPECT_EQ(HeapBytes(), before.arena);
  return !testing::Test::HasFailure();
}

using OneHeapDeathTest = OneHeap;

// In a process of its own: a heap that some thread got before UseOneHeap is there for good, and the next thread takes
// it.
TEST_F(OneHeapDeathTest, OtherThreadsUseItToo) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_EXIT(std::exit(OtherThreadsUseTheHeapThatIsHeld() ? 0 : 1), testing::ExitedWithCode(0), "");
}

// More than the heap could have free.
std::size_t TooLargeBy(std::size_t num_bytes) { return HeapBytes() + num_bytes; }

bool IsMappedAlone(std::size_t num_bytes) {
  const std::size_t num_before = ::mallinfo2().hblks;
  void* volatile block = std::malloc(num_bytes);
  const bool is_counted = ::mallinfo2().hblks == num_before + 1;
  std::free(block);
  return is_counted;
}

TEST_F(OneHeap, LargeBlocksAreMappedAloneButDuringASessionHoweverLargeAnEarlierOneWas) {
  EXPECT_TRUE(IsMappedAlone(TooLargeBy(8 * kLargeBlockBytes)));
  EXPECT_TRUE(IsMappedAlone(TooLargeBy(2 * kLargeBlockBytes)));
  EXPECT_FALSE(IsMappedAlone(kLargeBlockBytes / 2));
  ASSERT_TRUE(HoldHeap(kMegabyte));
  EXPECT_FALSE(IsMappedAlone(TooLargeBy(8 * kLargeBlockBytes)));
  ReleaseHeap();
  EXPECT_TRUE(IsMappedAlone(TooLargeBy(2 * kLargeBlockBytes)));
}

TEST_F(OneHeap, MemoryThatIsNotThereIsRefusedAndNothingIsChanged) {
  EXPECT_FALSE(HoldHeap(std::size_t{1} << 60));
  EXPECT_TRUE(IsMappedAlone(TooLargeBy(2 * kLargeBlockBytes)));
}

// Whether memory is mapped there.
bool IsMapped(std::uintptr_t address) {
  char byte = 0;
  const int memory = open("/proc/self/mem", O_RDONLY | O_CLOEXEC);
  const ssize_t count = pread(memory, &byte, 1, static_cast<off_t>(address));
  close(memory);
  return count == 1;
}

TEST_F(OneHeap, StacksOfThreadsThatHaveEndedAreUnmapped) {
  std::uintptr_t address = 0;
  std::thread([&address] {
    volatile char on_the_stack = 1;
    address = reinterpret_cast<std::uintptr_t>(&on_the_stack);
  }).join();
  EXPECT_TRUE(IsMapped(address));
  ReturnFreeMemory();
  EXPECT_FALSE(IsMapped(address));
}

}  // namespace
}  // namespace haustra
