#include "platform/realtime/one_heap.h"

#include <malloc.h>
#include <pthread.h>

#include <cstdlib>

namespace haustra {
namespace {

constexpr std::size_t kHeapPageBytes = 4096;
constexpr int kNever = -1;  // as a size: the largest there is
// What glibc begins with.
constexpr int kDefaultMaxMapped = 65536;
constexpr int kDefaultTrimBytes = 128 * 1024;
// glibc keeps stacks until they are more than 40 MB together.
constexpr std::size_t kMoreThanAllStacks = std::size_t{64} << 20;

void MapLargeBlocksAlone(bool alone) {
  ::mallopt(M_MMAP_MAX, alone ? kDefaultMaxMapped : 0);
  ::mallopt(M_TRIM_THRESHOLD, alone ? kDefaultTrimBytes : kNever);
}

// glibc gives up the oldest of the stacks that it keeps when one more does not fit: for one larger than all together it
// gives up every one, and then that one, too.
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

void UseOneHeap() {
  ::mallopt(M_ARENA_MAX, 1);
  ::mallopt(M_MMAP_THRESHOLD, kLargeBlockBytes);
}

bool HoldHeap(std::size_t num_free_bytes) {
  MapLargeBlocksAlone(false);
  auto* const block = static_cast<volatile char*>(std::malloc(num_free_bytes));
  if (block == nullptr) {
    MapLargeBlocksAlone(true);
    return false;
  }
  for (std::size_t i = 0; i < num_free_bytes; i += kHeapPageBytes) block[i] = 0;
  std::free(const_cast<char*>(block));
  return true;
}

void ReleaseHeap() {
  MapLargeBlocksAlone(true);
  ::malloc_trim(0);
}

void ReturnFreeMemory() {
  ReleaseStacks();
  ::malloc_trim(0);
}

std::size_t HeapBytes() { return ::mallinfo2().arena; }

}  // namespace haustra
