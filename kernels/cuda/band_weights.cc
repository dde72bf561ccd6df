#include "kernels/cuda/band_weights.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace haustra::kernels::cuda {
namespace {

constexpr int kUnitsPerOne = 1 << 13;

// A symmetric kernel of any radius, for products.
struct WideKernel {
  static constexpr int kMaxRadius = 95;
  int radius = 0;
  double w[kMaxRadius + 1] = {};

  double at(int j) const { return std::abs(j) <= radius ? w[std::abs(j)] : 0.0; }
};

WideKernel Identity() {
  WideKernel kernel;
  kernel.w[0] = 1.0;
  return kernel;
}

WideKernel Product(const WideKernel& a, const GaussianKernel& b) {
  WideKernel product;
  product.radius = a.radius + b.radius;
  for (int i = 0; i <= product.radius; ++i) {
    for (int j = -b.radius; j <= b.radius; ++j) product.w[i] += a.at(i - j) * b.weights[std::abs(j)];
  }
  return product;
}

// From level 0 of an octave to one of its levels.
WideKernel KernelToLevel(int level) {
  WideKernel kernel = Identity();
  for (int l = 1; l <= level; ++l) kernel = Product(kernel, KernelOfLevel(l));
  return kernel;
}

// A level of octave -1 from the enlarged image, then also from the grey image: odd pixels of the enlarged one are means
// of their neighbours. Distances in pixels of the enlarged image, between grey pixels twice that of their indices.
WideKernel KernelFromEnlarged(int level) { return Product(KernelToLevel(level), KernelOfLevel(0)); }
WideKernel WithEnlargement(const WideKernel& kernel) {
  WideKernel with;
  with.radius = kernel.radius + 1;
  for (int j = 0; j <= with.radius; ++j) with.w[j] = kernel.at(j) + 0.5 * (kernel.at(j - 1) + kernel.at(j + 1));
  return with;
}

// Level 0 of octave 0 from the grey image: level kScalesPerOctave of octave -1, every second pixel.
WideKernel KernelToOctaveZero() {
  const WideKernel fine = WithEnlargement(KernelFromEnlarged(kScalesPerOctave));
  WideKernel kernel;
  kernel.radius = fine.radius / 2;
  for (int j = 0; j <= kernel.radius; ++j) kernel.w[j] = fine.w[2 * j];
  return kernel;
}

WideKernel KernelFromGrey(int level) {
  WideKernel kernel = KernelToOctaveZero();
  for (int l = 1; l <= level; ++l) kernel = Product(kernel, KernelOfLevel(l));
  return kernel;
}

std::vector<float> CutOff(const WideKernel& kernel, int radius) {
  double sum = 0.0;
  for (int j = -radius; j <= radius; ++j) sum += kernel.at(j);
  std::vector<float> weights;
  for (int j = 0; j <= radius; ++j) weights.push_back(static_cast<float>(kernel.at(j) / sum));
  return weights;
}

// Half-precision floats have 11 significant bits.
bool IsExactAsHalf(int units) {
  while (units > 2048 && units % 2 == 0) units /= 2;
  return units <= 2048;
}

// A symmetric kernel whose weight j is at distance `first + j * step` on both sides (distance 0 counts once), in units
// that add up to kUnitsPerOne. Rounding keeps the variance: the even and the odd pixels of an enlarged picture have
// different weights, and must be blurred alike.
std::vector<int> ToUnits(const std::vector<double>& weights, int first, int step) {
  const auto times = [&](std::size_t j) { return first + static_cast<int>(j) * step == 0 ? 1 : 2; };
  const auto square = [&](std::size_t j) {
    const double distance = first + static_cast<double>(j) * step;
    return distance * distance;
  };
  double sum = 0.0;
  double moment = 0.0;
  for (std::size_t j = 0; j < weights.size(); ++j) {
    sum += times(j) * weights[j];
    moment += times(j) * weights[j] * square(j);
  }
  std::vector<int> units;
  int rest = kUnitsPerOne;
  double excess = -moment / sum * kUnitsPerOne;  // of the second moment
  for (std::size_t j = 0; j < weights.size(); ++j) {
    units.push_back(static_cast<int>(std::lround(weights[j] / sum * kUnitsPerOne)));
    rest -= times(j) * units[j];
    excess += times(j) * units[j] * square(j);
  }
  // What rounding left over goes to the first; then units move between two weights as long as that helps.
  const auto give = [&](std::size_t to, int count) {
    units[to] += count;
    excess += times(to) * count * square(to);
  };
  give(0, rest / times(0));
  const auto is_exact = [&] {
    return std::all_of(units.begin(), units.end(), [](int u) { return u >= 0 && IsExactAsHalf(u); });
  };
  while (true) {
    std::size_t best_from = 0;
    std::size_t best_to = 0;
    double best = is_exact() ? std::abs(excess) : std::numeric_limits<double>::max();
    const double before = excess;
    for (std::size_t from = 0; from < units.size(); ++from) {
      for (std::size_t to = 0; to < units.size(); ++to) {
        // Two of a single weight for one of a pair.
        const int given = 2 / times(to);
        const int taken = 2 / times(from);
        give(from, -taken);
        give(to, given);
        if (from != to && is_exact() && std::abs(excess) < best) {
          best = std::abs(excess);
          best_from = from;
          best_to = to;
        }
        give(from, taken);
        give(to, -given);
        excess = before;
      }
    }
    if (best_from == best_to) return units;
    give(best_from, -2 / times(best_from));
    give(best_to, 2 / times(best_to));
  }
}

// Weights of a level by distance, in pixels of the level for kEnlargedGrey (twice the source's), else of the source.
std::vector<int> UnitsByDistance(BandSource source, int level) {
  if (source == BandSource::kEnlargedGrey) {
    const WideKernel kernel = WithEnlargement(KernelFromEnlarged(level));
    constexpr int kReach = 2 * BandMargin(BandSource::kEnlargedGrey);
    std::vector<double> of_even;
    std::vector<double> of_odd;
    for (int d = 0; d <= kReach; d += 2) of_even.push_back(kernel.at(d));
    for (int d = 1; d < kReach; d += 2) of_odd.push_back(kernel.at(d));
    const std::vector<int> even = ToUnits(of_even, 0, 2);
    const std::vector<int> odd = ToUnits(of_odd, 1, 2);
    std::vector<int> units;
    for (int d = 0; d <= kReach; ++d) units.push_back(d % 2 == 0 ? even[d / 2] : odd[d / 2]);
    return units;
  }
  const WideKernel kernel = source == BandSource::kGrey ? KernelFromGrey(level) : KernelToLevel(level);
  std::vector<double> weights;
  for (int d = 0; d <= BandMargin(source); ++d) weights.push_back(kernel.at(d));
  return ToUnits(weights, 0, 1);
}

int Distance(BandSource source, int row, int source_row) {
  const int margin = BandMargin(source);
  return std::abs(source == BandSource::kEnlargedGrey ? row - 2 * (source_row - margin) : row - (source_row - margin));
}

// Bits of a half-precision float that is exact and normal, or 0.
std::uint32_t HalfBits(float value) {
  if (value == 0.0f) return 0;
  const int exponent = std::ilogb(value);
  const int mantissa = static_cast<int>(std::ldexp(value, 10 - exponent));
  return static_cast<std::uint32_t>((exponent + 15) << 10 | (mantissa - 1024));
}

}  // namespace

int BandWeight(BandSource source, int level, int row, int source_row) {
  const std::vector<int> units = UnitsByDistance(source, level);
  const int distance = Distance(source, row, source_row);
  return distance < static_cast<int>(units.size()) ? units[distance] : 0;
}

BandWeights MakeBandWeights(BandSource source) {
  BandWeights weights{};
  for (int level = 0; level < kNumLevels; ++level) {
    const std::vector<int> units = UnitsByDistance(source, level);
    const auto at = [&](int row, int source_row) -> std::uint32_t {
      const int distance = Distance(source, row, source_row);
      if (distance >= static_cast<int>(units.size())) return 0;
      return HalfBits(static_cast<float>(units[distance]) * (kBandScale / kUnitsPerOne));
    };
    const auto two = [&](int row, int source_row) { return at(row, source_row) | at(row, source_row + 1) << 16; };
    for (int step = 0; step < BandSteps(source); ++step) {
      for (int lane = 0; lane < 32; ++lane) {
        // PTX ISA, matrix fragments for mma.m16n8k16.
        const int row = lane / 4;
        const int source_row = 16 * step + lane % 4 * 2;
        weights.rows[level][step][lane] = {
            {two(row, source_row), two(row + 8, source_row), two(row, source_row + 8), two(row + 8, source_row + 8)}};
        weights.columns[level][step][lane] = {
            {two(row, source_row), two(row, source_row + 8), two(row + 8, source_row), two(row + 8, source_row + 8)}};
      }
    }
  }
  return weights;
}

std::vector<float> WeightsToNextOctave(int radius) { return CutOff(KernelToLevel(kScalesPerOctave), radius); }

std::vector<float> WeightsFromGreyToOctaveOne(int radius) { return CutOff(KernelFromGrey(kScalesPerOctave), radius); }

}  // namespace haustra::kernels::cuda
