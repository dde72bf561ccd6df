#include "capture/yuv.h"

#include <algorithm>
#include <array>

#include "capture/image_transform.h"
#include "hal/core/pixels.h"

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

}  // namespace

void LumaToGrey(ImageView image, Image* grey) {
  if (image.format == PixelFormat::kBgr8) {
    ToGrey(image, grey);
    return;
  }
  grey->Resize(image.width, image.height, PixelFormat::kGrey8);
  for (int y = 0; y < image.height; ++y) GreyOfRow(image, y, grey->row(y));
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
    std::uint8_t* to = colour->row(y);
    for (int x = 0; x < image.width; ++x, to += 3) {
      const std::array<std::uint8_t, 3> bgr = BgrAt(image, x, y);
      std::copy(bgr.begin(), bgr.end(), to);
    }
  }
}

}  // namespace haustra
