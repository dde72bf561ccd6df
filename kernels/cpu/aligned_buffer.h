// A block of memory taken once, aligned for vector loads. Elements are not initialised: pages that nobody touches cost
// nothing, so the caller decides what to touch ahead of use.
#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <type_traits>

namespace haustra::kernels {

// The next multiple of `alignment`, values not below zero.
constexpr int AlignUp(int value, int alignment) { return (value + alignment - 1) / alignment * alignment; }

template <typename T>
class AlignedBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  static constexpr std::size_t kAlignment = 64;

  AlignedBuffer() = default;
  // Throws std::bad_alloc; CreateCpuVisionDevice turns it into a status.
  explicit AlignedBuffer(std::size_t size)
      : data_(static_cast<T*>(::operator new (BytesFor(size), std::align_val_t{kAlignment}))), size_(size) {}

  // What a buffer of this size takes.
  static constexpr std::size_t BytesFor(std::size_t size) { return size * sizeof(T) + kAlignment; }

  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) { return data_.get()[i]; }
  const T& operator[](std::size_t i) const { return data_.get()[i]; }
  void SetZero() {
    if (size_ > 0) std::memset(static_cast<void*>(data_.get()), 0, size_ * sizeof(T));
  }

 private:
  struct Free {
    void operator()(T* p) const { ::operator delete (p, std::align_val_t{kAlignment}); }
  };
  std::unique_ptr<T, Free> data_;
  std::size_t size_ = 0;
};

}  // namespace haustra::kernels
