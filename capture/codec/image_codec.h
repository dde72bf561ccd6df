// PNG and JPEG files in and out.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "capture/image.h"
#include "hal/core/status.h"
#include "hal/core/views.h"

namespace haustra {

// Largest image that is read, so that a damaged header cannot ask for any amount of memory.
inline constexpr std::int64_t kMaxImagePixels = std::int64_t{64} << 20;

enum class ChannelChoice {
  kAsStored,  // grey files give kGrey8, colour files kBgr8
  kGrey,      // always kGrey8; for JPEG the stored luma itself, which is also the faster way to decode
};

struct ImageSize {
  int width_px = 0;
  int height_px = 0;
};

// Reads PNG and JPEG files; which of the two is told from the first bytes, not from the name. Keeps its buffers from
// one file to the next. thread-bound(the reader).
//
// PNG: grey, colour and palette; transparency is dropped. 16 bits a channel is refused: such files are depth maps or
// raw data, which no stage here expects. JPEG: grey and colour, baseline and progressive; orientation marks are
// ignored, since a calibration belongs to the pixels as they are stored.
class ImageReader {
 public:
  // Replaces the pixels of `image`; they are undefined after an error. Each message begins with the path.
  // kNotFound: no such file. kUnavailable: the file cannot be read. kDataLoss: damaged, cut short, or neither PNG nor
  // JPEG. kInvalidArgument: a kind of PNG or JPEG that is not supported. kCapacityExceeded: more than kMaxImagePixels.
  Status Read(const std::string& path, ChannelChoice channels, Image* image);

  // The size that the file's header states; errors as for Read.
  Result<ImageSize> ReadSize(const std::string& path);

 private:
  std::vector<std::uint8_t> file_;
  Image colour_;
};

// One file, for callers that read a single image.
Result<Image> ReadImage(const std::string& path, ChannelChoice channels);

// A file is there as a whole or not at all (files/file_sink.h), but may not outlast a power cut: frames come fast.
// quality 1 to 100; chroma is stored at half the resolution below quality 90, in full from there on.
// kInvalidArgument: empty image or quality out of range. kNotFound: no such folder. kUnavailable: cannot be written.
Status WriteJpeg(const std::string& path, ImageView image, int quality);
// Lossless. Errors as for WriteJpeg.
Status WritePng(const std::string& path, ImageView image);
// The bytes of a picture as a camera gives them. Errors of the file as for WriteJpeg.
Status WriteEncoded(const std::string& path, std::span<const std::uint8_t> bytes);

}  // namespace haustra
