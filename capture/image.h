// An image that owns its pixels. Rows start at multiples of 64 bytes from the first one; pixel layout as in
// hal/core/views.h. Value type, reentrant. Resize keeps the memory it has when that is large enough, so a buffer that
// is used again and again for frames of one size allocates once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "hal/core/views.h"

namespace haustra {

class Image {
 public:
  Image() = default;
  // width_px and height_px >= 0.
  Image(int width_px, int height_px, PixelFormat format) { Resize(width_px, height_px, format); }

  // The pixels are undefined afterwards.
  void Resize(int width_px, int height_px, PixelFormat format) {
    width_ = width_px;
    height_ = height_px;
    format_ = format;
    pitch_bytes_ = (static_cast<std::ptrdiff_t>(width_px) * BytesPerPixel(format) + 63) / 64 * 64;
    // Vector code may run over the end of the last row.
    constexpr std::size_t kTailBytes = 64;
    const std::size_t size =
        static_cast<std::size_t>(pitch_bytes_) * static_cast<std::size_t>(MemoryRows(format, height_px)) + kTailBytes;
    if (bytes_.size() < size) bytes_.resize(size);
  }

  bool is_empty() const { return width_ == 0 || height_ == 0; }
  int width() const { return width_; }
  int height() const { return height_; }
  PixelFormat format() const { return format_; }
  std::ptrdiff_t pitch_bytes() const { return pitch_bytes_; }
  std::uint8_t* row(int y) { return bytes_.data() + y * pitch_bytes_; }
  const std::uint8_t* row(int y) const { return bytes_.data() + y * pitch_bytes_; }

  // Valid until the next Resize, assignment or destruction; empty view for an empty image.
  ImageView view() const {
    if (is_empty()) return {};
    return {bytes_.data(), width_, height_, pitch_bytes_, format_};
  }

 private:
  std::vector<std::uint8_t> bytes_;
  int width_ = 0;
  int height_ = 0;
  std::ptrdiff_t pitch_bytes_ = 0;
  PixelFormat format_ = PixelFormat::kGrey8;
};

}  // namespace haustra
