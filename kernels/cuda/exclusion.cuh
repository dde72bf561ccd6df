// The exclusion masks that LaunchMasks has made, for those who look at them.
#pragma once

#include <cstdint>

#include "kernels/cuda/extract_buffers.h"

namespace haustra::kernels::cuda {

// Whether a pixel is within the dilated mask of its octave; x, y in octave pixels.
__device__ __forceinline__ bool IsExcluded(const ScaleSpaceLayout& layout, const std::uint32_t* dilated_bits, int slot,
                                           float x, float y) {
  const MaskLayout& mask = layout.masks[max(slot - 1, 0)];
  const std::uint32_t* words = dilated_bits;
  if (slot == 0) {
    x *= 0.5f;
    y *= 0.5f;
  } else {
    words += layout.masks[0].num_words + mask.first_word;
  }
  const int column = static_cast<int>(x);
  return (words[static_cast<int>(y) * mask.words + column / 32] >> column % 32 & 1) != 0;
}

}  // namespace haustra::kernels::cuda
