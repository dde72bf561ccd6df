#include "tests/kernels/allocation_counter.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<int> num_allocations{0};

}  // namespace

namespace haustra::testing {

int NumAllocations() { return num_allocations.load(); }

}  // namespace haustra::testing

void* operator new(std::size_t size) {
  ++num_allocations;
  void* p = std::malloc(size);
  if (p == nullptr) throw std::bad_alloc();
  return p;
}

void* operator new(std::size_t size, std::align_val_t alignment) {
  ++num_allocations;
  const std::size_t unit = static_cast<std::size_t>(alignment);
  void* p = std::aligned_alloc(unit, (size + unit - 1) / unit * unit);
  if (p == nullptr) throw std::bad_alloc();
  return p;
}

void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
