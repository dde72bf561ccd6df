// A vector of at most N elements held in place. Full: PushBack returns false and leaves the vector as it is.
// reentrant, rt-safe.
#pragma once

#include <array>
#include <cstddef>

#include "hal/core/check.h"

namespace haustra {

template <typename T, std::size_t N>
class FixedVector {
 public:
  [[nodiscard]] bool PushBack(const T& value) {
    if (size_ == N) return false;
    values_[size_++] = value;
    return true;
  }
  // Removes element i by moving the last one into its place (order is not kept).
  void SwapErase(std::size_t i) {
    HAUSTRA_DCHECK(i < size_);
    values_[i] = values_[--size_];
  }
  void Clear() { size_ = 0; }

  T& operator[](std::size_t i) {
    HAUSTRA_DCHECK(i < size_);
    return values_[i];
  }
  const T& operator[](std::size_t i) const {
    HAUSTRA_DCHECK(i < size_);
    return values_[i];
  }
  T* begin() { return values_.data(); }
  T* end() { return values_.data() + size_; }
  const T* begin() const { return values_.data(); }
  const T* end() const { return values_.data() + size_; }
  T* data() { return values_.data(); }
  const T* data() const { return values_.data(); }

  std::size_t size() const { return size_; }
  static constexpr std::size_t capacity() { return N; }
  bool empty() const { return size_ == 0; }
  bool full() const { return size_ == N; }

 private:
  std::array<T, N> values_{};
  std::size_t size_ = 0;
};

}  // namespace haustra
