// Brightness and colour of pixels of every format (views.h). rt-safe, reentrant.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "hal/core/views.h"

namespace haustra {

// Integer luma (Rec. 601), rounded.
inline void BgrToGrey(const std::uint8_t* bgr, int width, std::uint8_t* grey) {
  for (int x = 0; x < width; ++x) {
    grey[x] = static_cast<std::uint8_t>((29 * bgr[3 * x] + 150 * bgr[3 * x + 1] + 77 * bgr[3 * x + 2] + 128) >> 8);
  }
}

// Luma of a row, as the features are found in it.
inline void GreyOfRow(const ImageView& image, int y, std::uint8_t* grey) {
  const std::uint8_t* row = image.row(y);
  if (image.format == PixelFormat::kBgr8) return BgrToGrey(row, image.width, grey);
  const int step = BytesPerPixel(image.format);
  if (step == 1) {
    std::copy_n(row, image.width, grey);
    return;
  }
  if (image.format == PixelFormat::kUyvy) ++row;
  for (int x = 0; x < image.width; ++x) grey[x] = row[2 * x];
}

// Blue, green, red of brightness and colour differences (BT.601, full range), as JPEG has them.
inline std::array<std::uint8_t, 3> BgrOfYuv(int y, int cb, int cr) {
  const auto clamped = [](double value) { return static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L)); };
  return {clamped(y + 1.772 * (cb - 128)), clamped(y - 0.344136 * (cb - 128) - 0.714136 * (cr - 128)),
          clamped(y + 1.402 * (cr - 128))};
}

inline std::array<std::uint8_t, 3> BgrAt(const ImageView& image, int x, int y) {
  const std::uint8_t* row = image.row(y);
  switch (image.format) {
    case PixelFormat::kGrey8: return {row[x], row[x], row[x]};
    case PixelFormat::kBgr8: return {row[3 * x], row[3 * x + 1], row[3 * x + 2]};
    case PixelFormat::kNv12: {
      const std::uint8_t* chroma = image.row(image.height + y / 2) + x / 2 * 2;
      return BgrOfYuv(row[x], chroma[0], chroma[1]);
    }
    case PixelFormat::kYuyv: {
      const std::uint8_t* pair = row + x / 2 * 4;
      return BgrOfYuv(pair[x % 2 * 2], pair[1], pair[3]);
    }
    case PixelFormat::kUyvy: {
      const std::uint8_t* pair = row + x / 2 * 4;
      return BgrOfYuv(pair[1 + x % 2 * 2], pair[0], pair[2]);
    }
  }
  return {};
}

}  // namespace haustra
