#include "tests/platform/fixed_memory/heap_bytes.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::size_t> bytes_taken{0};

}  // namespace

namespace haustra::test {

std::size_t BytesTaken() { return bytes_taken.load(); }

}  // namespace haustra::test

void* operator new(std::size_t size) {
  bytes_taken += size;
  void* p = std::malloc(size);
  if (p == nullptr) throw std::bad_alloc();
  return p;
}

void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  bytes_taken += size;
  return std::malloc(size);
}

void* operator new(std::size_t size, std::align_val_t alignment) {
  bytes_taken += size;
  const std::size_t unit = static_cast<std::size_t>(alignment);
  void* p = std::aligned_alloc(unit, (size + unit - 1) / unit * unit);
  if (p == nullptr) throw std::bad_alloc();
  return p;
}

void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, const std::nothrow_t&) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
