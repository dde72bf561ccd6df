#include "tools/render/cover_order.h"

#include <algorithm>
#include <functional>

#include "tools/render/mucosa_painter.h"

namespace haustra::render {
namespace {

constexpr int kStep = 8;  // texels between two places that are ranked
constexpr int kQuantiles = 1024;
constexpr std::array<float, 4> kScales = {1.0f, 0.42f, 0.16f, 0.06f};
constexpr std::array<float, 4> kWeights = {1.0f, 0.42f, 0.15f, 0.045f};

}  // namespace

CoverOrder::CoverOrder(std::uint32_t seed, int rows, float patch_mm) {
  for (std::size_t i = 0; i < kScales.size(); ++i) {
    const int cells = std::max(1, static_cast<int>(kMucosaGirthMm / (2.0f * patch_mm * kScales[i])));
    octaves_.push_back({GradientNoise(seed + static_cast<std::uint32_t>(i), cells),
                        static_cast<float>(cells) / kMucosaColumns, kWeights[i]});
  }
  std::vector<float> heights;
  for (int row = 0; row < rows; row += kStep) {
    for (int column = 0; column < kMucosaColumns; column += kStep) heights.push_back(Height(row, column));
  }
  std::sort(heights.begin(), heights.end(), std::greater<>());
  for (int i = 0; i <= kQuantiles; ++i) quantiles_.push_back(heights[(heights.size() - 1) * i / kQuantiles]);
}

float CoverOrder::Height(int row, int column) const {
  float sum = 0.0f;
  for (const Octave& octave : octaves_) {
    sum += octave.weight * octave.noise.At(static_cast<float>(row) * octave.cells_per_texel,
                                           static_cast<float>(column) * octave.cells_per_texel);
  }
  return sum;
}

float CoverOrder::Rank(int row, int column) const {
  const auto above = std::lower_bound(quantiles_.begin(), quantiles_.end(), Height(row, column), std::greater<>());
  return static_cast<float>(above - quantiles_.begin()) / static_cast<float>(quantiles_.size());
}

}  // namespace haustra::render
