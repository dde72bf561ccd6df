#include "capture/codec/jpeg_codec.h"
#include "capture/codec/png_codec.h"
#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {
namespace {

using capture::internal::DecodeJpeg;
using capture::internal::DecodeJpegSize;
using capture::internal::DecodePng;
using capture::internal::DecodePngSize;
using capture::internal::JpegDecoder;

// Larger ones are decoded like small ones, and take long.
constexpr std::int64_t kMaxPixels = 1 << 18;

bool IsSmall(const Result<ImageSize>& size) {
  if (!size.ok()) return false;
  HAUSTRA_CHECK(size->width_px > 0 && size->height_px > 0);
  HAUSTRA_CHECK(std::int64_t{size->width_px} * size->height_px <= kMaxImagePixels);
  return std::int64_t{size->width_px} * size->height_px <= kMaxPixels;
}

void Check(const Status& status, const ImageSize& size, const Image& image) {
  if (!status.ok()) {
    HAUSTRA_CHECK(!status.message().empty());
    return;
  }
  HAUSTRA_CHECK(image.width() == size.width_px && image.height() == size.height_px);
  // Every byte of it is there.
  unsigned sum = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width() * BytesPerPixel(image.format()); ++x) sum += image.row(y)[x];
  }
  volatile unsigned used = sum;
  (void)used;
}

}  // namespace

void FuzzImage(std::span<const std::uint8_t> bytes) {
  Image image;
  if (const Result<ImageSize> size = DecodePngSize(bytes); IsSmall(size)) {
    Check(DecodePng(bytes, &image), *size, image);
  }
  if (const Result<ImageSize> size = DecodeJpegSize(bytes); IsSmall(size)) {
    JpegDecoder decoder(*size);
    for (const ChannelChoice channels : {ChannelChoice::kAsStored, ChannelChoice::kGrey}) {
      const Status status = DecodeJpeg(bytes, channels, &image);
      Check(status, *size, image);
      // In memory of a camera's decoder, the second time after another picture.
      const Status ours = decoder.Decode(bytes, channels, &image);
      Check(ours, *size, image);
      HAUSTRA_CHECK(ours.code() == status.code() || ours.code() == StatusCode::kCapacityExceeded);
    }
  }
}

}  // namespace haustra::test
