// Sizes and places of everything that depends on the size of the image.
#pragma once

#include <cstddef>

#include "kernels/cuda/extract_buffers.h"

namespace haustra::kernels::cuda {

// The size must be at least kMinOctaveSizePx each way.
ScaleSpaceLayout MakeLayout(int width_px, int height_px);

// Elements that buffers need for a layout; they grow with the size of the image.
struct LayoutSizes {
  std::size_t plane_values = 0;
  std::size_t mask_words = 0;
  std::size_t max_extrema = 0;
  std::size_t kept_values = 0;
};
LayoutSizes SizesOf(const ScaleSpaceLayout& layout);

}  // namespace haustra::kernels::cuda
