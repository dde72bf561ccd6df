#include "capture/side_by_side.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "capture/image.h"
#include "capture/image_transform.h"

namespace haustra {
namespace {

// A half is reduced until it has as few columns, or as few rows: noise and sharpness of two cameras differ, what is
// left does not. Half a picture of 192x192 stays as it is.
constexpr int kColumns = 128;
constexpr int kRows = 72;
// Of the reduced half. A fold or vessel is in it, and few have two depths.
constexpr int kBlock = 12;
constexpr int kArea = kBlock * kBlock;
// To either side, this part of the width. Laparoscopes have disparities up to a tenth.
constexpr int kShiftsOfWidth = 8;
// Halves that are not rectified.
constexpr int kMaxShiftY = 2;
// Standard deviation in levels of 255, below which a block is flat, or has edges in one direction alone.
constexpr double kMinTexture = 2.0;
constexpr double kMinOfSought = 0.5;  // of that, in the other half: it may be darker
constexpr double kMinCorrelation = 0.85;

struct Reduced {
  int width = 0;
  int height = 0;
  std::vector<float> levels;

  const float* row(int y) const { return levels.data() + static_cast<std::ptrdiff_t>(y) * width; }
};

Reduced Reduce(const Image& grey, int left, int top, int width, int height) {
  const int step = std::max(1, std::min((width + kColumns - 1) / kColumns, (height + kRows - 1) / kRows));
  Reduced reduced{width / step, height / step, {}};
  reduced.levels.reserve(static_cast<std::size_t>(reduced.width) * static_cast<std::size_t>(reduced.height));
  for (int y = 0; y < reduced.height; ++y) {
    for (int x = 0; x < reduced.width; ++x) {
      int sum = 0;
      for (int j = 0; j < step; ++j) {
        const auto* pixels = grey.row(top + y * step + j) + left + x * step;
        for (int i = 0; i < step; ++i) sum += pixels[i];
      }
      reduced.levels.push_back(static_cast<float>(sum) / static_cast<float>(step * step));
    }
  }
  return reduced;
}

// Without the means of rows and columns: an edge of the picture, or light that falls off, is no texture.
struct Block {
  float levels[kArea];
  double norm = 0.0;
};

Block BlockAt(const Reduced& half, int x, int y) {
  float row_mean[kBlock] = {}, column_mean[kBlock] = {}, mean = 0.0f;
  for (int j = 0; j < kBlock; ++j) {
    for (int i = 0; i < kBlock; ++i) {
      const float level = half.row(y + j)[x + i] / kBlock;
      row_mean[j] += level;
      column_mean[i] += level;
      mean += level / kBlock;
    }
  }
  Block block;
  double squares = 0.0;
  for (int j = 0; j < kBlock; ++j) {
    for (int i = 0; i < kBlock; ++i) {
      const float level = half.row(y + j)[x + i] - row_mean[j] - column_mean[i] + mean;
      block.levels[j * kBlock + i] = level;
      squares += static_cast<double>(level) * level;
    }
  }
  block.norm = std::sqrt(squares);
  return block;
}

bool IsFound(const Block& sought, const Reduced& half, int x, int y) {
  const int max_shift = half.width / kShiftsOfWidth;
  for (int top = std::max(0, y - kMaxShiftY); top <= std::min(half.height - kBlock, y + kMaxShiftY); ++top) {
    for (int left = std::max(0, x - max_shift); left <= std::min(half.width - kBlock, x + max_shift); ++left) {
      const Block other = BlockAt(half, left, top);
      if (other.norm < kMinOfSought * kMinTexture * kBlock) continue;
      double product = 0.0;
      for (int i = 0; i < kArea; ++i) product += static_cast<double>(sought.levels[i]) * other.levels[i];
      if (product >= kMinCorrelation * sought.norm * other.norm) return true;
    }
  }
  return false;
}

}  // namespace

HalvesMatch& HalvesMatch::operator+=(const HalvesMatch& other) {
  num_blocks += other.num_blocks;
  num_found += other.num_found;
  num_chance += other.num_chance;
  return *this;
}

bool AreTwoViews(const HalvesMatch& match) {
  return match.num_blocks >= kMinTwoViewsBlocks &&
         match.num_found - match.num_chance >= kMinTwoViewsShare * match.num_blocks;
}

HalvesMatch MatchHalves(ImageView image, Halves halves) {
  HalvesMatch match;
  Image grey;
  ToGrey(image, &grey);
  const bool is_beside = halves == Halves::kLeftAndRight;
  const int width = is_beside ? image.width / 2 : image.width, height = is_beside ? image.height : image.height / 2;
  const Reduced first = Reduce(grey, 0, 0, width, height);
  const Reduced second = Reduce(grey, image.width - width, image.height - height, width, height);
  // What is searched at two places a third of the height apart must not overlap.
  if (first.width < kBlock || first.height < 3 * (kBlock + 2 * kMaxShiftY)) return match;
  const int end = first.height - kBlock;
  for (int y = 0; y <= end; y += kBlock) {
    const int elsewhere = y + first.height / 3 <= end ? y + first.height / 3 : y - first.height / 3;
    for (int x = 0; x + kBlock <= first.width; x += kBlock) {
      const Block block = BlockAt(first, x, y);
      if (block.norm < kMinTexture * kBlock) continue;
      ++match.num_blocks;
      match.num_found += IsFound(block, second, x, y);
      match.num_chance += IsFound(block, second, x, elsewhere);
    }
  }
  return match;
}

}  // namespace haustra
