// One block of memory that is taken and touched at start-up and then dealt out once, front to back: the home of every
// pool of fixed size. Nothing is ever given back to it, so what is built in it keeps its size for its whole life.
// A component states what it will take in units of MemoryArena::BytesFor; the arena is made with the sum, and
// construction that asks for more than was stated throws std::bad_alloc. thread-bound(whoever constructs).
#pragma once

#include <cstddef>
#include <cstring>
#include <memory_resource>
#include <new>

namespace haustra {

class MemoryArena final : public std::pmr::memory_resource {
 public:
  // Every block begins on a cache line of its own.
  static constexpr std::size_t kAlignment = 64;

  // What an array of `count` elements takes, padding included.
  template <typename T>
  static constexpr std::size_t BytesFor(std::size_t count) {
    static_assert(alignof(T) <= kAlignment);
    return RoundUp(count * sizeof(T));
  }

  // Takes `size_bytes` and writes to every page, so that none of them faults later. Throws std::bad_alloc.
  explicit MemoryArena(std::size_t size_bytes)
      : data_(static_cast<std::byte*>(::operator new (RoundUp(size_bytes), std::align_val_t{kAlignment}))),
        size_(RoundUp(size_bytes)) {
    std::memset(data_, 0, size_);
  }
  ~MemoryArena() override { ::operator delete (data_, std::align_val_t{kAlignment}); }
  MemoryArena(const MemoryArena&) = delete;
  MemoryArena& operator=(const MemoryArena&) = delete;

  std::size_t size_bytes() const { return size_; }
  std::size_t used_bytes() const { return used_; }

 private:
  static constexpr std::size_t RoundUp(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    const std::size_t rounded = RoundUp(bytes);
    if (alignment > kAlignment || rounded > size_ - used_) throw std::bad_alloc();
    void* block = data_ + used_;
    used_ += rounded;
    return block;
  }
  void do_deallocate(void*, std::size_t, std::size_t) override {}
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }

  std::byte* data_;
  std::size_t size_;
  std::size_t used_ = 0;
};

}  // namespace haustra
