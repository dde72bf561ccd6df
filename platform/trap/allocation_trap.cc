#include "platform/trap/allocation_trap.h"

#include <execinfo.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define HAUSTRA_TRAPS_MALLOC 1
#else
#define HAUSTRA_TRAPS_MALLOC 0
#endif

namespace {

enum TrapMode : int { kOff = 0, kCounting = 1, kAborting = 2 };

thread_local int mode = kOff;
thread_local std::uint32_t num_calls = 0;

#if HAUSTRA_TRAPS_MALLOC
void Write(const char* text) { (void)!write(STDERR_FILENO, text, std::strlen(text)); }

void Caught(const char* function) {
  ++num_calls;
  if (mode != kAborting) return;
  mode = kOff;
  Write("haustra: allocation trap: ");
  Write(function);
  Write(" on a thread that must not use the heap\n");
  void* frames[32];
  backtrace_symbols_fd(frames, backtrace(frames, 32), STDERR_FILENO);
  std::abort();
}

inline void Check(const char* function) {
  if (mode != kOff) Caught(function);
}
#endif

}  // namespace

#if HAUSTRA_TRAPS_MALLOC
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* block);

void* malloc(std::size_t size) {
  Check("malloc");
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  Check("calloc");
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  Check("realloc");
  return __libc_realloc(block, size);
}
void free(void* block) {
  if (block != nullptr) Check("free");
  __libc_free(block);
}
void* memalign(std::size_t alignment, std::size_t size) {
  Check("memalign");
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  Check("aligned_alloc");
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  Check("posix_memalign");
  void* taken = __libc_memalign(alignment, size);
  if (taken == nullptr) return ENOMEM;
  *block = taken;
  return 0;
}
}
#endif

namespace haustra {
namespace {

void BeginCounting() {
  num_calls = 0;
  mode = kCounting;
}
void BeginAborting() {
  num_calls = 0;
  mode = kAborting;
}
std::uint32_t End() {
  mode = kOff;
  return num_calls;
}

}  // namespace

bool AllocationTrap::IsAvailable() { return HAUSTRA_TRAPS_MALLOC; }

AllocationTrap::AllocationTrap(Mode wanted) : former_mode_(mode), former_count_(num_calls) {
  num_calls = 0;
  mode = wanted == Mode::kAbort ? kAborting : kCounting;
}

AllocationTrap::~AllocationTrap() {
  mode = former_mode_;
  num_calls = former_count_;
}

std::uint32_t AllocationTrap::count() const { return num_calls; }

const ThreadWatch& CountingHeapWatch() {
  static constexpr ThreadWatch kWatch{BeginCounting, End};
  return kWatch;
}

const ThreadWatch& AbortingHeapWatch() {
  static constexpr ThreadWatch kWatch{BeginAborting, End};
  return kWatch;
}

}  // namespace haustra
