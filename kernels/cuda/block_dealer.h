// Deals out one block of memory, front to back, every piece on a multiple of kAlignment. Without a block nothing is
// dealt out, only counted: what plans memory and what carries the plan out is the same code, so the two cannot differ.
// A piece that does not fit is not dealt out (nullptr), but counted, so that used_bytes() tells. reentrant.
#pragma once

#include <cstddef>
#include <type_traits>

namespace haustra::kernels::cuda {

class BlockDealer {
 public:
  static constexpr std::size_t kAlignment = 256;  // that of cudaMalloc, on which kernels count

  BlockDealer() = default;  // only counts
  // `block` lies on a multiple of kAlignment and outlives what is dealt out.
  BlockDealer(std::byte* block, std::size_t num_bytes) : block_(block), num_bytes_(num_bytes) {}

  // Room for `count` values.
  template <typename T>
  T* Deal(std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kAlignment);
    const std::size_t first = used_bytes_;
    used_bytes_ += (count * sizeof(T) + kAlignment - 1) / kAlignment * kAlignment;
    return used_bytes_ <= num_bytes_ ? reinterpret_cast<T*>(block_ + first) : nullptr;
  }
  std::size_t used_bytes() const { return used_bytes_; }

 private:
  std::byte* block_ = nullptr;
  std::size_t num_bytes_ = 0;
  std::size_t used_bytes_ = 0;
};

}  // namespace haustra::kernels::cuda
