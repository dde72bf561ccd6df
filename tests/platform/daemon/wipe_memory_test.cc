// Memory that has been given back, read where it was, as somebody would who searches the process.
#include "platform/daemon/wipe_memory.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "tests/sanitized.h"

namespace haustra {
namespace {

constexpr std::size_t kBytes = 512;
constexpr std::uint8_t kSecret = 0xc3;

// How many bytes of the secret stand there; -1: no memory is mapped there any more.
int CountSecret(std::uintptr_t address) {
  std::uint8_t bytes[kBytes];
  const int memory = open("/proc/self/mem", O_RDONLY | O_CLOEXEC);
  const ssize_t count = pread(memory, bytes, kBytes, static_cast<off_t>(address));
  close(memory);
  if (count != static_cast<ssize_t>(kBytes)) return -1;
  int num = 0;
  for (const std::uint8_t byte : bytes) num += byte == kSecret;
  return num;
}

// So deep that no call in between overwrites it by chance.
[[gnu::noinline]] std::uintptr_t LeaveOnTheStack() {
  volatile std::uint8_t deep[65536];
  for (std::size_t i = 0; i < kBytes; ++i) deep[i] = kSecret;
  return reinterpret_cast<std::uintptr_t>(&deep[0]);
}

TEST(WipeMemory, SmallBlocksThatTheThreadKeepsAreOverwritten) {
  if (test::kIsSanitized) GTEST_SKIP() << "the sanitizer's heap is not the one that is meant";
  OverwriteFreedMemory();
  // So many that none of this size is left that was freed before; then seven, which the thread keeps.
  std::vector<void*> blocks(1000);
  for (void*& block : blocks) block = std::malloc(kBytes);
  std::vector<std::uintptr_t> freed;
  for (; freed.size() < 7; blocks.pop_back()) {
    freed.push_back(reinterpret_cast<std::uintptr_t>(blocks.back()));
    std::memset(blocks.back(), kSecret, kBytes);
    std::free(blocks.back());
  }
  int num_before = 0, num_after = 0;
  for (const std::uintptr_t address : freed) num_before += CountSecret(address);
  WipeThisThread();
  for (const std::uintptr_t address : freed) num_after += CountSecret(address);
  EXPECT_GT(num_before, 6 * static_cast<int>(kBytes));
  // In each, the list of free blocks has a pointer and a key of any value.
  EXPECT_LE(num_after, 7 * 16);
  for (void* block : blocks) std::free(block);
}

TEST(WipeMemory, TheStackBelowIsOverwritten) {
  if (test::kIsSanitized) GTEST_SKIP() << "the sanitizer's stack is not the one that is meant";
  const std::uintptr_t address = LeaveOnTheStack();
  EXPECT_EQ(CountSecret(address), static_cast<int>(kBytes));
  WipeThisThread();
  EXPECT_EQ(CountSecret(address), 0);
}

TEST(WipeMemory, StacksOfThreadsThatHaveEndedAreUnmapped) {
  if (test::kIsSanitized) GTEST_SKIP() << "the sanitizer's stack is not the one that is meant";
  std::uintptr_t address = 0;
  // Not so close to its top that the end of the thread needs that part; what lies more than 16 kB deep the C library
  // gives back by itself.
  std::thread([&address] {
    volatile std::uint8_t stack[10000];
    for (std::size_t i = 0; i < kBytes; ++i) stack[i] = kSecret;
    address = reinterpret_cast<std::uintptr_t>(&stack[0]);
  }).join();
  EXPECT_EQ(CountSecret(address), static_cast<int>(kBytes));
  ReturnFreeMemory();
  EXPECT_EQ(CountSecret(address), -1);
}

}  // namespace
}  // namespace haustra
