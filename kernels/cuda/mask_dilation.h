// Dilation of masks that hold 32 pixels of a row in a word, the leftmost in the lowest bit.
#pragma once

#include <bit>
#include <cstdint>

#ifdef __CUDACC__
#define HAUSTRA_HOST_DEVICE __host__ __device__
#else
#define HAUSTRA_HOST_DEVICE
#endif

namespace haustra::kernels::cuda {

// Of a word that is not 0.
HAUSTRA_HOST_DEVICE inline int NumZerosAbove(std::uint32_t bits) {
#ifdef __CUDA_ARCH__
  return __clz(static_cast<int>(bits));
#else
  return std::countl_zero(bits);
#endif
}
HAUSTRA_HOST_DEVICE inline int NumZerosBelow(std::uint32_t bits) {
#ifdef __CUDA_ARCH__
  return __ffs(static_cast<int>(bits)) - 1;
#else
  return std::countr_zero(bits);
#endif
}

// The word of a row's pixels that have one that is set within `reach` to either side. word_at(k): the word k places to
// the right, 0 outside of the row.
template <typename WordAt>
HAUSTRA_HOST_DEVICE std::uint32_t DilatedWord(int reach, const WordAt& word_at) {
  std::uint32_t result = word_at(0);
  // What was dilated by d is shifted by d + 1 at most: further, and pixels beside the ends of the word were missing, as
  // what has left the word does not come back.
  for (int done = 0; done < reach && done < 31;) {
    const int step = done + 1 < reach - done ? done + 1 : reach - done;
    result |= result << step | result >> step;
    done += step;
  }
  // Of the words beside, the nearest pixel decides.
  for (int k = 1; 32 * (k - 1) < reach; ++k) {
    const int rest = reach - 32 * (k - 1);
    const std::uint32_t left = word_at(-k);
    const std::uint32_t right = word_at(k);
    const int from_left = left != 0 ? rest - NumZerosAbove(left) : 0;  // so many pixels from the left end on
    const int from_right = right != 0 ? rest - NumZerosBelow(right) : 0;
    if (from_left > 0) result |= from_left < 32 ? (1u << from_left) - 1 : 0xffffffffu;
    if (from_right > 0) result |= from_right < 32 ? ~(0xffffffffu >> from_right) : 0xffffffffu;
  }
  return result;
}

}  // namespace haustra::kernels::cuda
