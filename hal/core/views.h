// Non-owning views: pointer, extent, pitch and format.
#pragma once

#include <cstddef>
#include <cstdint>

namespace haustra {

enum class PixelFormat : std::uint8_t {
  kGrey8,  // 1 byte a pixel
  kBgr8,   // 3 bytes a pixel, blue first
};

inline constexpr int BytesPerPixel(PixelFormat format) { return format == PixelFormat::kGrey8 ? 1 : 3; }

// Rows from top to bottom; pixel centres at integer coordinates, (0, 0) is the centre of the top left pixel.
// Host memory. pitch_bytes >= width * BytesPerPixel(format).
struct ImageView {
  const std::uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t pitch_bytes = 0;
  PixelFormat format = PixelFormat::kGrey8;

  bool is_empty() const { return data == nullptr || width <= 0 || height <= 0; }
  const std::uint8_t* row(int y) const { return data + y * pitch_bytes; }
};

}  // namespace haustra
