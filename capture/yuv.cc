#include "capture/yuv.h"

#include <algorithm>
#include <cmath>

#include "capture/image_transform.h"

namespace haustra {
namespace {

// Where the luma of a pixel lies in its row: luma[x * step].
struct LumaLayout {
  int offset = 0;
  int step = 1;
};

LumaLayout LayoutOf(PixelFormat format) {
  switch (format) {
    case PixelFormat::kYuyv: return {0, 2};
    case PixelFormat::kUyvy: return {1, 2};
    default: return {0, 1};
  }
}

std::uint8_t Clamped(double value) { return static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L)); }

void WriteBgr(int y, int cb, int cr, std::uint8_t* bgr) {
  bgr[0] = Clamped(y + 1.772 * (cb - 128));
  bgr[1] = Clamped(y - 0.344136 * (cb - 128) - 0.714136 * (cr - 128));
  bgr[2] = Clamped(y + 1.402 * (cr - 128));
}

}  // namespace

void LumaToGrey(ImageView image, Image* grey) {
  if (image.format == PixelFormat::kBgr8) {
    ToGrey(image, grey);
    return;
  }
  const LumaLayout luma = LayoutOf(image.format);
  grey->Resize(image.width, image.height, PixelFormat::kGrey8);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* from = image.row(y) + luma.offset;
    std::uint8_t* to = grey->row(y);
    for (int x = 0; x < image.width; ++x) to[x] = from[x * luma.step];
  }
}

void HalveLuma(ImageView image, Image* half) {
  const LumaLayout luma = LayoutOf(image.format);
  half->Resize(image.width / 2, image.height / 2, PixelFormat::kGrey8);
  for (int y = 0; y < half->height(); ++y) {
    const std::uint8_t* top = image.row(2 * y) + luma.offset;
    const std::uint8_t* bottom = image.row(2 * y + 1) + luma.offset;
    std::uint8_t* to = half->row(y);
    for (int x = 0; x < half->width(); ++x) {
      const int left = 2 * x * luma.step;
      const int right = left + luma.step;
      to[x] = static_cast<std::uint8_t>((top[left] + top[right] + bottom[left] + bottom[right] + 2) / 4);
    }
  }
}

void HalveColumns(ImageView field, Image* half) {
  const LumaLayout luma = LayoutOf(field.format);
  half->Resize(field.width / 2, field.height, PixelFormat::kGrey8);
  for (int y = 0; y < half->height(); ++y) {
    const std::uint8_t* from = field.row(y) + luma.offset;
    std::uint8_t* to = half->row(y);
    for (int x = 0; x < half->width(); ++x) {
      to[x] = static_cast<std::uint8_t>((from[2 * x * luma.step] + from[(2 * x + 1) * luma.step] + 1) / 2);
    }
  }
}

void ToBgr(ImageView image, Image* colour) {
  if (image.format == PixelFormat::kGrey8 || image.format == PixelFormat::kBgr8) {
    CopyImage(image, colour);
    return;
  }
  colour->Resize(image.width, image.height, PixelFormat::kBgr8);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* row = image.row(y);
    std::uint8_t* to = colour->row(y);
    for (int x = 0; x < image.width; ++x, to += 3) {
      if (image.format == PixelFormat::kNv12) {
        const std::uint8_t* chroma = image.row(image.height + y / 2) + x / 2 * 2;
        WriteBgr(row[x], chroma[0], chroma[1], to);
      } else if (image.format == PixelFormat::kYuyv) {
        const std::uint8_t* pair = row + x / 2 * 4;
        WriteBgr(pair[x % 2 * 2], pair[1], pair[3], to);
      } else {
        const std::uint8_t* pair = row + x / 2 * 4;
        WriteBgr(pair[1 + x % 2 * 2], pair[0], pair[2], to);
      }
    }
  }
}

}  // namespace haustra
