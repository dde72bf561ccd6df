#include "capture/deinterlace.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "capture/concat.h"

namespace haustra {
namespace {

// Odd, so that groups begin at rows of both fields, and no multiple of the 8 rows of JPEG's blocks.
constexpr int kGroupRows = 9;

int RowBytes(PixelFormat format, int width) { return width * BytesPerPixel(format); }

struct RowDifferences {
  std::uint64_t neighbours = 0;  // sums over num_bytes
  std::uint64_t every_other = 0;
  std::uint64_t num_bytes = 0;
};

RowDifferences Differences(ImageView image) {
  RowDifferences sums;
  const int row_bytes = RowBytes(image.format, image.width);
  for (int y = 0; y + 2 < image.height; y += kGroupRows) {
    const std::uint8_t* first = image.row(y);
    const std::uint8_t* second = image.row(y + 1);
    const std::uint8_t* third = image.row(y + 2);
    std::uint32_t neighbours = 0, every_other = 0;
    for (int i = 0; i < row_bytes; ++i) {
      neighbours += static_cast<std::uint32_t>(std::abs(second[i] - first[i]));
      every_other += static_cast<std::uint32_t>(std::abs(third[i] - first[i]));
    }
    sums.neighbours += neighbours;
    sums.every_other += every_other;
    sums.num_bytes += static_cast<std::uint64_t>(row_bytes);
  }
  return sums;
}

// Combing of columns, by the first row of each group. Of kYuyv and kUyvy the luma: their chroma alternates by itself.
double CombingOfColumns(ImageView image) {
  const bool is_packed = image.format == PixelFormat::kYuyv || image.format == PixelFormat::kUyvy;
  const int step = BytesPerPixel(image.format);
  const int begin = image.format == PixelFormat::kUyvy ? 1 : 0;
  const int stride = is_packed ? step : 1;
  std::uint64_t neighbours = 0, every_other = 0;
  for (int y = 0; y < image.height; y += kGroupRows) {
    const std::uint8_t* row = image.row(y);
    for (int i = begin; i + 2 * step < RowBytes(image.format, image.width); i += stride) {
      neighbours += static_cast<std::uint64_t>(std::abs(row[i + step] - row[i]));
      every_other += static_cast<std::uint64_t>(std::abs(row[i + 2 * step] - row[i]));
    }
  }
  return every_other == 0 ? 0.0 : static_cast<double>(neighbours) / static_cast<double>(every_other);
}

// Of one plane.
void FillOddRows(std::uint8_t* rows, std::ptrdiff_t pitch_bytes, int row_bytes, int num_rows) {
  for (int y = 1; y < num_rows; y += 2) {
    std::uint8_t* row = rows + y * pitch_bytes;
    const std::uint8_t* above = row - pitch_bytes;
    if (y + 1 == num_rows) {
      std::memcpy(row, above, static_cast<std::size_t>(row_bytes));
      return;
    }
    const std::uint8_t* below = row + pitch_bytes;
    for (int i = 0; i < row_bytes; ++i) row[i] = static_cast<std::uint8_t>((above[i] + below[i] + 1) >> 1);
  }
}

}  // namespace

Result<DeinterlaceChoice> ParseDeinterlaceChoice(std::string_view text) {
  if (text == "auto") return DeinterlaceChoice::kAuto;
  if (text == "off") return DeinterlaceChoice::kOff;
  if (text == "on") return DeinterlaceChoice::kOn;
  return InvalidArgument(capture::internal::Concat("deinterlace '", text, "' is none of auto, off, on"));
}

double Combing(ImageView image) {
  const RowDifferences sums = Differences(image);
  if (sums.neighbours == 0) return 0.0;
  // Rows that are alike two by two, and differ from their neighbours: combed as much as can be.
  return static_cast<double>(sums.neighbours) / static_cast<double>(sums.every_other > 0 ? sums.every_other : 1);
}

bool IsCombed(ImageView image) {
  const RowDifferences sums = Differences(image);
  const auto neighbours = static_cast<double>(sums.neighbours), every_other = static_cast<double>(sums.every_other);
  if (neighbours <= kCombedFrom * every_other || neighbours < kMinCombedLevels * static_cast<double>(sums.num_bytes)) {
    return false;
  }
  const double columns_above_noise = std::max(0.0, CombingOfColumns(image) - 1.0);
  return neighbours - every_other > kRowsBeforeColumns * columns_above_noise * every_other;
}

void KeepTopField(Image* image) {
  if (image->is_empty()) return;
  const int height = image->height();
  const int row_bytes = RowBytes(image->format(), image->width());
  FillOddRows(image->row(0), image->pitch_bytes(), row_bytes, height);
  FillOddRows(image->row(height), image->pitch_bytes(), row_bytes, MemoryRows(image->format(), height) - height);
}

void KeepTopField(ImageView image, Image* kept) {
  kept->Resize(image.width, image.height, image.format);
  const auto row_bytes = static_cast<std::size_t>(RowBytes(image.format, image.width));
  // Both planes of kNv12 begin with an even row. The odd ones may lie in memory that is slow to read.
  for (int y = 0; y < MemoryRows(image.format, image.height); y += 2)
    std::memcpy(kept->row(y), image.row(y), row_bytes);
  KeepTopField(kept);
}

bool Deinterlacer::WantsTopField(ImageView image) {
  if (choice_ != DeinterlaceChoice::kAuto) return choice_ == DeinterlaceChoice::kOn;
  if (num_combed_ >= kMinCombed) return true;
  if (!IsCombed(image)) return false;
  num_combed_ += Combing(image) >= kClearlyCombedFrom ? kMinCombed : 1;
  return true;
}

}  // namespace haustra
