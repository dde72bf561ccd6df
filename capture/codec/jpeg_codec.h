// TurboJPEG behind a Status. Bytes in memory only; messages do not name a file, the caller adds it. reentrant.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "capture/codec/image_codec.h"
#include "capture/image.h"
#include "hal/core/status.h"

namespace haustra::capture::internal {

bool IsJpeg(std::span<const std::uint8_t> bytes);
// Decodes one picture after the other. It keeps what TurboJPEG sets up once. For a picture the library takes 7 to 9
// blocks of up to 30 KB from the heap, 94 KB together at 1440x1080 (libjpeg-turbo 2.1), and gives them back; it has no
// way to be given memory. So a decoding thread may wait, as often, for a thread that is at the heap. thread-bound(its
// owner).
class JpegDecoder {
 public:
  JpegDecoder();
  ~JpegDecoder();
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  // kDataLoss also for what the library only warns of: a file cut short or with bad entropy codes decodes to grey or
  // shifted blocks, which look like a scene to everything downstream. Bytes between the last block and the end marker
  // are no damage: cameras fill up with them. Memory of `image` is used again.
  Status Decode(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image);

 private:
  void* codec_;
};

// With a decoder of its own.
Status DecodeJpeg(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image);
Result<ImageSize> DecodeJpegSize(std::span<const std::uint8_t> bytes);
Status EncodeJpeg(ImageView image, int quality, std::vector<std::uint8_t>* bytes);

}  // namespace haustra::capture::internal
