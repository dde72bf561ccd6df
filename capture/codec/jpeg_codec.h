// libjpeg-turbo behind a Status. Bytes in memory only; messages do not name a file, the caller adds it. reentrant.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "capture/codec/image_codec.h"
#include "capture/image.h"
#include "hal/core/status.h"

namespace haustra::capture::internal {

bool IsJpeg(std::span<const std::uint8_t> bytes);
class JpegMemory;
class LibjpegDecoder;

// Decodes a camera's pictures, one after the other, in memory that is taken at construction: a whole picture asks
// nothing of the heap (of libjpeg-turbo 2.1 and 3), so that a thread in real time waits for nobody who does. An error
// has a message, which is on the heap. thread-bound(its owner).
class JpegDecoder {
 public:
  explicit JpegDecoder(ImageSize largest);
  ~JpegDecoder();
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  // Memory of `image` is used again. Nothing of a picture is kept for the next, which must bring its own tables (but
  // the usual Huffman tables, which Motion-JPEG leaves out). kDataLoss, as DecodeJpeg. kCapacityExceeded: larger than
  // the largest, or a progressive picture, which cannot be decoded row by row; no camera sends one.
  Status Decode(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image);

 private:
  const ImageSize largest_;
  std::unique_ptr<JpegMemory> memory_;
  std::unique_ptr<LibjpegDecoder> decoder_;
};

// Any picture, with the library's own memory. kDataLoss also for what the library only warns of: a file cut short or
// with bad entropy codes decodes to grey or shifted blocks, which look like a scene to everything downstream. Bytes
// between the last block and the end marker are no damage: cameras fill up with them.
Status DecodeJpeg(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image);
Result<ImageSize> DecodeJpegSize(std::span<const std::uint8_t> bytes);
Status EncodeJpeg(ImageView image, int quality, std::vector<std::uint8_t>* bytes);

}  // namespace haustra::capture::internal
