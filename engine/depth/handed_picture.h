// Pictures on their way from tracking to the mapping thread. A full ring: the newest is left out and counted, and its
// keyframe has no depth.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory_resource>
#include <vector>

#include "hal/core/memory_arena.h"
#include "hal/core/spsc_ring.h"
#include "hal/core/time.h"
#include "hal/core/views.h"
#include "hal/frame_source.h"

namespace haustra {

struct HandedPicture {
  HandedPicture(int width_px, int height_px, std::pmr::memory_resource* memory)
      : pixels(MaxBytes(width_px, height_px), memory) {}
  // Of the format with most bytes a pixel.
  static std::size_t MaxBytes(int width_px, int height_px) {
    return std::size_t{3} * static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }

  // rt-safe. False: the frame is larger than was planned.
  bool Copy(const Frame& frame) {
    const ImageView& from = frame.image;
    const std::ptrdiff_t row_bytes = static_cast<std::ptrdiff_t>(from.width) * BytesPerPixel(from.format);
    const int num_rows = MemoryRows(from.format, from.height);
    if (static_cast<std::size_t>(row_bytes) * num_rows > pixels.size()) return false;
    for (int y = 0; y < num_rows; ++y) std::copy_n(from.row(y), row_bytes, pixels.data() + y * row_bytes);
    frame_index = frame.index;
    timestamp = frame.timestamp;
    image = {pixels.data(), from.width, from.height, row_bytes, from.format};
    return true;
  }

  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  ImageView image;  // of `pixels`
  std::pmr::vector<std::uint8_t> pixels;
};

// Keyframes come less often than every second frame.
inline constexpr std::size_t kHandedPictures = 4;

using PictureRing = SpscRing<HandedPicture>;

}  // namespace haustra
