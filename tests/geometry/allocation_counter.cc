#include "tests/geometry/allocation_counter.h"

#include <cerrno>
#include <cstdlib>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define HAUSTRA_COUNTS_MALLOC 1
#else
#define HAUSTRA_COUNTS_MALLOC 0
#endif

namespace {

thread_local bool is_counting = false;
thread_local std::size_t allocations = 0;

#if HAUSTRA_COUNTS_MALLOC
void Count() {
  if (is_counting) ++allocations;
}
#endif

}  // namespace

#if HAUSTRA_COUNTS_MALLOC
// operator new of libstdc++ ends here as well. Freed by glibc's own free, which knows these blocks.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  Count();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  Count();
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  Count();
  return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  Count();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  Count();
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
}
#endif

namespace haustra::test {

bool AllocationCounter::IsAvailable() { return HAUSTRA_COUNTS_MALLOC; }
AllocationCounter::AllocationCounter() {
  allocations = 0;
  is_counting = true;
}
AllocationCounter::~AllocationCounter() { is_counting = false; }
std::size_t AllocationCounter::count() const { return allocations; }

}  // namespace haustra::test
