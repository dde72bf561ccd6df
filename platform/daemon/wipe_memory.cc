#include "platform/daemon/wipe_memory.h"

#include <malloc.h>
#include <pthread.h>
#include <string.h>

#include <array>
#include <cstddef>
#include <cstdlib>

namespace haustra {
namespace {

// glibc's tcache: of each size in steps of 16 up to the largest, at most 7 blocks.
constexpr std::size_t kSmallestCached = 24, kLargestCached = 1032, kSizeStep = 16;
constexpr std::size_t kMaxCached = 7;
// Deeper than any call on a thread that outlives a procedure.
constexpr std::size_t kDeepestStack = std::size_t{1} << 20;
// glibc keeps stacks until they are more than 40 MB together.
constexpr std::size_t kMoreThanAllStacks = std::size_t{64} << 20;

[[gnu::noinline]] void WipeDeadStack() {
  std::array<std::byte, kDeepestStack> dead;
  ::explicit_bzero(dead.data(), dead.size());
}

// What is cached is what malloc gives first.
void WipeCachedBlocks() {
  for (std::size_t size = kSmallestCached; size <= kLargestCached; size += kSizeStep) {
    std::array<void*, kMaxCached> blocks{};
    for (void*& block : blocks) {
      block = std::malloc(size);
      if (block != nullptr) ::explicit_bzero(block, ::malloc_usable_size(block));
    }
    for (void* block : blocks) std::free(block);
  }
}

// The oldest stacks go when one more does not fit: one that fits by no means drives out all, and then itself.
void ReleaseStacks() {
  pthread_attr_t attributes;
  if (::pthread_attr_init(&attributes) != 0) return;
  pthread_t thread;
  if (::pthread_attr_setstacksize(&attributes, kMoreThanAllStacks) == 0 &&
      ::pthread_create(
          &thread, &attributes, [](void*) -> void* { return nullptr; }, nullptr) == 0) {
    ::pthread_join(thread, nullptr);
  }
  ::pthread_attr_destroy(&attributes);
}

}  // namespace

void OverwriteFreedMemory() { ::mallopt(M_PERTURB, 0x5a); }

void WipeThisThread() {
  WipeDeadStack();
  WipeCachedBlocks();
}

void ReturnFreeMemory() {
  ReleaseStacks();
  ::malloc_trim(0);
}

}  // namespace haustra
