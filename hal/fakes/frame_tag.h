// How the scripted frame source tells the scripted vision device which frame a picture shows: a mark in the first bytes
// of its top row, so that the engine between the two handles a picture like any other. reentrant, rt-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "hal/core/views.h"

namespace haustra {

inline constexpr int kFrameTagBytes = 8;  // a picture must be at least this wide

// Writes the mark into the first bytes of a picture.
inline void WriteFrameTag(std::uint32_t frame_index, std::span<std::uint8_t> pixels) {
  constexpr std::uint8_t kMagic[4] = {0x48, 0x41, 0x55, 0x53};
  for (int i = 0; i < 4; ++i) {
    pixels[i] = kMagic[i];
    pixels[4 + i] = static_cast<std::uint8_t>(frame_index >> (8 * i));
  }
}

// Nothing for a picture without a mark.
inline std::optional<std::uint32_t> ReadFrameTag(const ImageView& image) {
  if (image.is_empty() || image.width * BytesPerPixel(image.format) < kFrameTagBytes) return std::nullopt;
  constexpr std::uint8_t kMagic[4] = {0x48, 0x41, 0x55, 0x53};
  std::uint32_t frame_index = 0;
  for (int i = 0; i < 4; ++i) {
    if (image.data[i] != kMagic[i]) return std::nullopt;
    frame_index |= static_cast<std::uint32_t>(image.data[4 + i]) << (8 * i);
  }
  return frame_index;
}

}  // namespace haustra
