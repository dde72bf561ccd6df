#include "kernels/cpu/exclusion_mask.h"

#include <algorithm>

namespace haustra::kernels {
namespace {

int HalfUp(int size) { return (size + 1) / 2; }

// out[i] = max of in[i - radius .. i + radius], outside counts as 0. By doubling: windows of 1, 2, 4, ... are joined,
// so the number of passes grows with the logarithm of the radius. `in` and `out` have `radius` readable zeros on either
// side of the n values.
void DilateLine(std::uint8_t* line, int n, int radius, std::uint8_t* __restrict out) {
  // line[-radius .. n + radius) is valid; windows grow to the right: after a pass, line[i] covers [i, i + width).
  const int window = 2 * radius + 1;
  int width = 1;
  std::uint8_t* first = line - radius;
  int count = n + 2 * radius;
  while (2 * width <= window) {
    for (int i = 0; i + width < count; ++i) first[i] |= first[i + width];
    width *= 2;
  }
  const int rest = window - width;
  for (int i = 0; i < n; ++i) out[i] = first[i] | first[i + rest];
}

}  // namespace

ExclusionMask::ExclusionMask(int max_width_px, int max_height_px, const MaskOptions& options)
    : options_(options), levels_(kMaxOctaves + 1), columns_alive_(max_width_px) {
  int width = max_width_px;
  int height = max_height_px;
  for (int octave = 0; octave < kMaxOctaves; ++octave) {
    const std::size_t size = static_cast<std::size_t>(width) * height;
    levels_[octave].raw = AlignedBuffer<std::uint8_t>(size);
    levels_[octave].dilated = AlignedBuffer<std::uint8_t>(size);
    width = HalfUp(width);
    height = HalfUp(height);
  }
  const std::size_t size = static_cast<std::size_t>(max_width_px) * max_height_px;
  levels_[kHalfDilation].dilated = AlignedBuffer<std::uint8_t>(size);
  scratch_ = AlignedBuffer<std::uint8_t>(size + max_width_px + 2 * options.dilation_px);
}

std::size_t ExclusionMask::BytesFor(int max_width_px, int max_height_px, const MaskOptions& options) {
  using Buffer = AlignedBuffer<std::uint8_t>;
  const std::size_t size = static_cast<std::size_t>(max_width_px) * max_height_px;
  std::size_t bytes = (kMaxOctaves + 1) * sizeof(Level) + Buffer::BytesFor(size) + Buffer::BytesFor(max_width_px) +
                      Buffer::BytesFor(size + max_width_px + 2 * options.dilation_px);
  int width = max_width_px;
  int height = max_height_px;
  for (int octave = 0; octave < kMaxOctaves; ++octave) {
    bytes += 2 * Buffer::BytesFor(static_cast<std::size_t>(width) * height);
    width = HalfUp(width);
    height = HalfUp(height);
  }
  return bytes;
}

void ExclusionMask::Prefault() {
  for (Level& level : levels_) {
    level.raw.SetZero();
    level.dilated.SetZero();
  }
  scratch_.SetZero();
  columns_alive_.SetZero();
}

void ExclusionMask::Build(const std::uint8_t* grey, int width_px, int height_px, int pitch_bytes,
                          ImageView static_mask) {
  Level& finest = levels_[0];
  finest.width_px = width_px;
  finest.height_px = height_px;
  MarkReflections(grey, pitch_bytes);
  if (options_.border_threshold > 0) MarkSurround(grey, pitch_bytes);
  if (!static_mask.is_empty()) {
    for (int y = 0; y < height_px; ++y) {
      const std::uint8_t* in = static_mask.row(y);
      std::uint8_t* out = finest.raw.data() + static_cast<std::size_t>(y) * width_px;
      for (int x = 0; x < width_px; ++x) out[x] |= in[x] == 0 ? 255 : 0;
    }
  }
  for (int octave = 1; octave < kMaxOctaves; ++octave) {
    const Level& from = levels_[octave - 1];
    Level& to = levels_[octave];
    to.width_px = HalfUp(from.width_px);
    to.height_px = HalfUp(from.height_px);
    for (int y = 0; y < to.height_px; ++y) {
      const std::uint8_t* upper = from.raw.data() + static_cast<std::size_t>(2 * y) * from.width_px;
      const std::uint8_t* lower = 2 * y + 1 < from.height_px ? upper + from.width_px : upper;
      std::uint8_t* out = to.raw.data() + static_cast<std::size_t>(y) * to.width_px;
      for (int x = 0; x < from.width_px / 2; ++x) {
        out[x] = upper[2 * x] | upper[2 * x + 1] | lower[2 * x] | lower[2 * x + 1];
      }
      if (from.width_px % 2 != 0) out[to.width_px - 1] = upper[from.width_px - 1] | lower[from.width_px - 1];
    }
  }
  for (int octave = 0; octave < kMaxOctaves; ++octave) Dilate(levels_[octave], options_.dilation_px, levels_[octave]);
  Level& half = levels_[kHalfDilation];
  half.width_px = width_px;
  half.height_px = height_px;
  Dilate(finest, (options_.dilation_px + 1) / 2, half);
}

void ExclusionMask::MarkReflections(const std::uint8_t* grey, int pitch_bytes) {
  Level& mask = levels_[0];
  const int threshold = options_.reflection_threshold;
  for (int y = 0; y < mask.height_px; ++y) {
    const std::uint8_t* in = grey + static_cast<std::size_t>(y) * pitch_bytes;
    std::uint8_t* out = mask.raw.data() + static_cast<std::size_t>(y) * mask.width_px;
    for (int x = 0; x < mask.width_px; ++x) out[x] = in[x] >= threshold ? 255 : 0;
  }
}

// The surround is dark and reaches the edge of the image; the lumen and dim walls are dark too, and don't. A pixel
// belongs to the surround when all pixels between it and one of the four edges are dark.
void ExclusionMask::MarkSurround(const std::uint8_t* grey, int pitch_bytes) {
  Level& mask = levels_[0];
  const int threshold = options_.border_threshold;
  for (int y = 0; y < mask.height_px; ++y) {
    const std::uint8_t* in = grey + static_cast<std::size_t>(y) * pitch_bytes;
    std::uint8_t* out = mask.raw.data() + static_cast<std::size_t>(y) * mask.width_px;
    int left = 0;
    while (left < mask.width_px && in[left] < threshold) out[left++] = 255;
    int right = mask.width_px - 1;
    while (right > left && in[right] < threshold) out[right--] = 255;
  }
  std::uint8_t* alive = columns_alive_.data();
  for (const bool downwards : {true, false}) {
    std::fill_n(alive, mask.width_px, std::uint8_t{255});
    for (int i = 0; i < mask.height_px; ++i) {
      const int y = downwards ? i : mask.height_px - 1 - i;
      const std::uint8_t* in = grey + static_cast<std::size_t>(y) * pitch_bytes;
      std::uint8_t* out = mask.raw.data() + static_cast<std::size_t>(y) * mask.width_px;
      std::uint8_t any = 0;
      for (int x = 0; x < mask.width_px; ++x) {
        alive[x] &= in[x] < threshold ? 255 : 0;
        out[x] |= alive[x];
        any |= alive[x];
      }
      if (any == 0) break;
    }
  }
}

void ExclusionMask::Dilate(const Level& from, int radius_px, Level& to) {
  const int width = from.width_px;
  const int height = from.height_px;
  const std::uint8_t* raw = from.raw.data();
  // Columns first, a row of pixels at a time.
  std::uint8_t* vertical = scratch_.data();
  for (int y = 0; y < height; ++y) {
    std::uint8_t* out = vertical + static_cast<std::size_t>(y) * width;
    const int first = std::max(y - radius_px, 0);
    const int last = std::min(y + radius_px, height - 1);
    std::copy_n(raw + static_cast<std::size_t>(first) * width, width, out);
    for (int r = first + 1; r <= last; ++r) {
      const std::uint8_t* in = raw + static_cast<std::size_t>(r) * width;
      for (int x = 0; x < width; ++x) out[x] |= in[x];
    }
  }
  std::uint8_t* line = vertical + static_cast<std::size_t>(width) * height;
  for (int y = 0; y < height; ++y) {
    std::fill_n(line, width + 2 * radius_px, std::uint8_t{0});
    std::copy_n(vertical + static_cast<std::size_t>(y) * width, width, line + radius_px);
    DilateLine(line + radius_px, width, radius_px, to.dilated.data() + static_cast<std::size_t>(y) * width);
  }
}

}  // namespace haustra::kernels
