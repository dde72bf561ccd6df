#include "engine/surface/depth_median.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <span>

#include "hal/core/check.h"

namespace haustra {
namespace {

// Wider windows gain little (engine/surface/decisions/2026-11-30-median-by-light.md).
constexpr double kNearSigma = 3.0;          // cells
constexpr double kLightSigma = 0.1;         // of the logarithm of the brightness
constexpr double kLightStepsPerLog = 64.0;  // whole numbers compare alike on every machine
constexpr double kDarkest = 2.0;            // grey; the logarithm of less would be noise

std::int32_t Weight(double distance, double sigma) {
  return static_cast<std::int32_t>(std::lround(255.0 * std::exp(-0.5 * distance * distance / (sigma * sigma))));
}

// The least code that, with all below it, has half of the weight.
std::int32_t WeightedMedian(std::span<const std::int32_t> codes, std::span<const std::int32_t> weights,
                            std::int32_t total) {
  const auto [least, most] = std::minmax_element(codes.begin(), codes.end());
  std::int32_t low = *least, high = *most;
  while (low < high) {
    const std::int32_t middle = (low + high) / 2;
    std::int32_t below = 0;
    // Without a branch, that nothing could predict.
    for (std::size_t i = 0; i < codes.size(); ++i) below += weights[i] * static_cast<std::int32_t>(codes[i] <= middle);
    if (below >= total - below) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

}  // namespace

DepthMedian::DepthMedian(int width, int height)
    : width_(width), height_(height), brightness_(std::size_t(width) * height), codes_(std::size_t(width) * height) {
  for (int y = -kRadius; y <= kRadius; ++y) {
    for (int x = -kRadius; x <= kRadius; ++x) {
      near_weights_[(y + kRadius) * kSide + x + kRadius] = Weight(std::hypot(x, y), kNearSigma);
    }
  }
  for (int i = 0; i <= kMaxLightSteps; ++i) light_weights_[i] = Weight(i, kLightStepsPerLog * kLightSigma);
}

std::size_t DepthMedian::BytesFor(int num_cells) {
  return std::size_t(num_cells) * (sizeof(std::int16_t) + sizeof(std::uint16_t));
}

void DepthMedian::ReadBrightness(ImageView grey, int step_px) {
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      int sum = 0;
      for (int v = 0; v < step_px; ++v) {
        const std::uint8_t* row = grey.row(y * step_px + v) + x * step_px;
        for (int u = 0; u < step_px; ++u) sum += row[u];
      }
      const double mean = std::max(kDarkest, static_cast<double>(sum) / (step_px * step_px));
      brightness_[y * width_ + x] = static_cast<std::int16_t>(std::lround(kLightStepsPerLog * std::log(mean)));
    }
  }
}

// The code that the cell is to have; its own where it is no outlier. `map`: may hold replaced codes already, only its
// confidences are read.
std::uint16_t DepthMedian::Replaced(int x, int y, const DepthMap& map) const {
  std::array<std::int32_t, kSide * kSide> codes, weights;
  const int own = y * width_ + x;
  std::size_t count = 0;
  std::int32_t total = 0;  // of at most 81 weights of 24 bits
  for (int v = std::max(-kRadius, -y); v <= std::min(kRadius, height_ - 1 - y); ++v) {
    for (int u = std::max(-kRadius, -x); u <= std::min(kRadius, width_ - 1 - x); ++u) {
      const int other = own + v * width_ + u;
      const int light = std::abs(brightness_[other] - brightness_[own]);
      if (codes_[other] == DepthMap::kNoDepth || light > kMaxLightSteps) continue;
      codes[count] = codes_[other];
      weights[count] = near_weights_[(v + kRadius) * kSide + u + kRadius] * light_weights_[light] *
                       static_cast<std::int32_t>(map.confidence(other));
      total += weights[count++];
    }
  }
  if (total == 0) return codes_[own];
  const auto seen_weights = std::span(weights).first(count);
  const auto seen = std::span(codes).first(count);
  const std::int32_t median = WeightedMedian(seen, seen_weights, total);
  const auto distance_of = [&](std::int32_t code) { return code > median ? code - median : median - code; };
  for (std::int32_t& code : seen) code = distance_of(code);
  const bool is_outlier = distance_of(codes_[own]) > WeightedMedian(seen, seen_weights, total);
  return is_outlier ? static_cast<std::uint16_t>(median) : codes_[own];
}

void DepthMedian::Apply(ImageView grey, int step_px, DepthMap* map) {
  HAUSTRA_CHECK(map->width() == width_ && map->height() == height_);
  HAUSTRA_CHECK(grey.width >= width_ * step_px && grey.height >= height_ * step_px);
  ReadBrightness(grey, step_px);
  std::copy(map->codes().begin(), map->codes().end(), codes_.begin());
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const int cell = y * width_ + x;
      if (map->has_depth(cell)) map->Replace(cell, Replaced(x, y, *map));
    }
  }
}

}  // namespace haustra
