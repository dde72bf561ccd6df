#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"
#include "tools/command/range_picture.h"

namespace haustra::test {

void FuzzRangePicture(std::span<const std::uint8_t> bytes) {
  const MemoryFile file(bytes);
  const Result<RangePicture> picture = ReadRangePicture(file.path());
  if (!picture.ok()) {
    HAUSTRA_CHECK(!picture.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(picture->width > 0 && picture->height > 0);
  HAUSTRA_CHECK(picture->range_mm.size() == std::size_t(picture->width) * static_cast<std::size_t>(picture->height));
  // Written and read again it is the same.
  const MemoryFile again(RangePictureBytes(*picture));
  const Result<RangePicture> read = ReadRangePicture(again.path());
  HAUSTRA_CHECK(read.ok() && read->width == picture->width && read->range_mm == picture->range_mm);
}

}  // namespace haustra::test
