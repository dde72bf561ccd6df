// Non-owning views: pointer, extent, pitch and format.
#pragma once

#include <cstddef>
#include <cstdint>

namespace haustra {

// Of the YUV formats the engine uses the luma, as it comes: 0 is black and 255 is white (full range).
enum class PixelFormat : std::uint8_t {
  kGrey8,  // 1 byte a pixel
  kBgr8,   // 3 bytes a pixel, blue first
  kNv12,   // a plane of luma, 1 byte a pixel, and right behind it rows of the same pitch with Cb, Cr of 2x2 pixels
  kYuyv,   // Y0 Cb Y1 Cr: 2 bytes a pixel
  kUyvy,   // Cb Y0 Cr Y1: 2 bytes a pixel
};

// Of kNv12 in the plane of luma.
inline constexpr int BytesPerPixel(PixelFormat format) {
  switch (format) {
    case PixelFormat::kBgr8: return 3;
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy: return 2;
    case PixelFormat::kGrey8:
    case PixelFormat::kNv12: break;
  }
  return 1;
}

// Rows of pitch_bytes that a picture has in memory: more than its height where a plane of colour follows.
inline constexpr int MemoryRows(PixelFormat format, int height) {
  return format == PixelFormat::kNv12 ? height + (height + 1) / 2 : height;
}

// Rows from top to bottom; pixel centres at integer coordinates, (0, 0) is the centre of the top left pixel.
// Host memory: MemoryRows(format, height) rows. pitch_bytes >= width * BytesPerPixel(format). The width of kYuyv and
// kUyvy, and both sides of kNv12, are even.
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
