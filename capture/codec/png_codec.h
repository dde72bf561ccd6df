// libpng behind a Status. Bytes in memory only; messages do not name a file, the caller adds it. reentrant.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "capture/codec/image_codec.h"
#include "capture/image.h"
#include "hal/core/status.h"

namespace haustra::capture::internal {

bool IsPng(std::span<const std::uint8_t> bytes);
// kGrey8 or kBgr8, as stored.
Status DecodePng(std::span<const std::uint8_t> bytes, Image* image);
Result<ImageSize> DecodePngSize(std::span<const std::uint8_t> bytes);
Status EncodePng(ImageView image, std::vector<std::uint8_t>* bytes);

}  // namespace haustra::capture::internal
