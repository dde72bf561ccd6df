#include "capture/image_transform.h"

#include <cstring>

namespace haustra {
namespace {

template <int kChannels>
void HalveRow(const std::uint8_t* upper, const std::uint8_t* lower, int half_width, std::uint8_t* out) {
  for (int x = 0; x < half_width; ++x) {
    for (int c = 0; c < kChannels; ++c) {
      const int left = 2 * x * kChannels + c;
      const int right = left + kChannels;
      const int sum = upper[left] + upper[right] + lower[left] + lower[right];
      out[x * kChannels + c] = static_cast<std::uint8_t>((sum + 2) >> 2);
    }
  }
}

}  // namespace

void HalveImage(ImageView image, Image* half) {
  half->Resize(image.width / 2, image.height / 2, image.format);
  for (int y = 0; y < half->height(); ++y) {
    if (image.format == PixelFormat::kGrey8) {
      HalveRow<1>(image.row(2 * y), image.row(2 * y + 1), half->width(), half->row(y));
    } else {
      HalveRow<3>(image.row(2 * y), image.row(2 * y + 1), half->width(), half->row(y));
    }
  }
}

void HalveMask(ImageView mask, Image* half) {
  half->Resize(mask.width / 2, mask.height / 2, PixelFormat::kGrey8);
  for (int y = 0; y < half->height(); ++y) {
    const std::uint8_t* upper = mask.row(2 * y);
    const std::uint8_t* lower = mask.row(2 * y + 1);
    std::uint8_t* out = half->row(y);
    for (int x = 0; x < half->width(); ++x, upper += 2, lower += 2) {
      const int all = upper[0] & upper[1] & lower[0] & lower[1];
      out[x] = (all & 0x80) != 0 ? 255 : 0;
    }
  }
}

void ToGrey(ImageView image, Image* grey) {
  if (image.format == PixelFormat::kGrey8) return CopyImage(image, grey);
  grey->Resize(image.width, image.height, PixelFormat::kGrey8);
  // 0.299, 0.587, 0.114 in units of 1/65536; they add up to exactly 65536, so white stays 255.
  constexpr int kRed = 19595;
  constexpr int kGreen = 38470;
  constexpr int kBlue = 7471;
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* bgr = image.row(y);
    std::uint8_t* out = grey->row(y);
    for (int x = 0; x < image.width; ++x, bgr += 3) {
      out[x] = static_cast<std::uint8_t>((kBlue * bgr[0] + kGreen * bgr[1] + kRed * bgr[2] + 32768) >> 16);
    }
  }
}

void CopyImage(ImageView image, Image* copy) {
  copy->Resize(image.width, image.height, image.format);
  const std::size_t row_bytes = static_cast<std::size_t>(image.width) * BytesPerPixel(image.format);
  const int num_rows = MemoryRows(image.format, image.height);
  for (int y = 0; y < num_rows; ++y) std::memcpy(copy->row(y), image.row(y), row_bytes);
}

}  // namespace haustra
