#include "kernels/cuda/band_weights.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace haustra::kernels::cuda {
namespace {

constexpr int kUnitsPerOne = 1 << 16;

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

WideKernel Wide(const GaussianKernel& kernel) {
  WideKernel wide;
  wide.radius = kernel.radius;
  for (int j = 0; j <= kernel.radius; ++j) wide.w[j] = kernel.weights[j];
  return wide;
}

// First a, then b on every `spacing`-th pixel.
WideKernel Product(const WideKernel& a, const WideKernel& b, int spacing = 1) {
  WideKernel product;
  product.radius = a.radius + spacing * b.radius;
  for (int i = 0; i <= product.radius; ++i) {
    for (int j = -b.radius; j <= b.radius; ++j) product.w[i] += a.at(i - spacing * j) * b.at(j);
  }
  return product;
}

// From level 0 of an octave to one of its levels.
WideKernel KernelToLevel(int level) {
  WideKernel kernel = Identity();
  for (int l = 1; l <= level; ++l) kernel = Product(kernel, Wide(KernelOfLevel(l)));
  return kernel;
}

// A level of octave -1 from the enlarged image, then also from the grey image: odd pixels of the enlarged one are means
// of their neighbours. Distances in pixels of the enlarged image, between grey pixels twice that of their indices.
WideKernel KernelFromEnlarged(int level) { return Product(KernelToLevel(level), Wide(KernelOfLevel(0))); }
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
  for (int l = 1; l <= level; ++l) kernel = Product(kernel, Wide(KernelOfLevel(l)));
  return kernel;
}

std::vector<float> CutOff(const WideKernel& kernel, int radius) {
  double sum = 0.0;
  for (int j = -radius; j <= radius; ++j) sum += kernel.at(j);
  std::vector<float> weights;
  for (int j = 0; j <= radius; ++j) weights.push_back(static_cast<float>(kernel.at(j) / sum));
  return weights;
}

// Half-precision floats have 11 significant bits: larger weights come in steps of more than a unit.
int StepOf(int units) {
  int step = 1;
  while (units >= 2048 * step) step *= 2;
  return step;
}
bool IsExactAsHalf(int units) { return units >= 0 && units % StepOf(units) == 0; }

// A symmetric kernel whose weight j is at distance `first + j * step` on both sides (distance 0 counts once), in units
// that add up to kUnitsPerOne, each exact as a half-precision float. Rounding keeps the variance as well as it can: the
// even and the odd pixels of an enlarged picture have different weights, and must be blurred alike.
std::vector<int> ToUnits(const std::vector<double>& weights, int first, int step) {
  const auto times = [&](std::size_t j) { return first + static_cast<int>(j) * step == 0 ? 1 : 2; };
  const auto square = [&](std::size_t j) {
    const double distance = first + static_cast<double>(j) * step;
    return distance * distance;
  };
  double sum = 0.0;
  for (std::size_t j = 0; j < weights.size(); ++j) sum += times(j) * weights[j];
  std::vector<int> units;
  int rest = kUnitsPerOne;  // still to be given out
  double excess = 0.0;      // of the second moment
  for (std::size_t j = 0; j < weights.size(); ++j) {
    const double exact = weights[j] / sum * kUnitsPerOne;
    const int grain = StepOf(static_cast<int>(exact));
    units.push_back(static_cast<int>(std::lround(exact / grain)) * grain);
    rest -= times(j) * units[j];
    excess += times(j) * (units[j] - exact) * square(j);
  }
  const auto give = [&](std::size_t to, int count) {
    units[to] += count;
    rest -= times(to) * count;
    excess += times(to) * count * square(to);
  };
  // What rounding left over goes, a step at a time, to where it serves the variance best.
  while (rest != 0) {
    std::size_t best_to = units.size();
    int best_count = 0;
    double best = std::numeric_limits<double>::max();
    for (std::size_t to = 0; to < units.size(); ++to) {
      const int count = rest > 0 ? StepOf(units[to]) : -StepOf(units[to]);
      if (!IsExactAsHalf(units[to] + count) || std::abs(times(to) * count) > std::abs(rest)) continue;
      const double after = std::abs(excess + times(to) * count * square(to));
      if (after < best) {
        best = after;
        best_to = to;
        best_count = count;
      }
    }
    if (best_to == units.size()) break;  // none is fine enough: a test sees to it that this does not happen
    give(best_to, best_count);
  }
  // Then units move between two weights as long as that helps.
  while (true) {
    std::size_t best_from = 0;
    std::size_t best_to = 0;
    int best_amount = 0;
    double best = std::abs(excess);
    for (std::size_t from = 0; from < units.size(); ++from) {
      for (std::size_t to = 0; to < units.size(); ++to) {
        const int amount = std::max(StepOf(units[from]) * times(from), StepOf(units[to]) * times(to));
        if (from == to || !IsExactAsHalf(units[from] - amount / times(from)) ||
            !IsExactAsHalf(units[to] + amount / times(to))) {
          continue;
        }
        const double after = std::abs(excess + amount * (square(to) - square(from)));
        if (after >= best) continue;
        best = after;
        best_from = from;
        best_to = to;
        best_amount = amount;
      }
    }
    if (best_from == best_to) return units;
    give(best_from, -best_amount / times(best_from));
    give(best_to, best_amount / times(best_to));
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

std::vector<float> WeightsOfReduction(int factor, bool from_grey) {
  const WideKernel to_next = KernelToLevel(kScalesPerOctave);
  const WideKernel first = from_grey ? KernelFromGrey(kScalesPerOctave) : to_next;
  return CutOff(factor == 2 ? first : Product(first, to_next, 2), ReductionRadius(factor));
}

}  // namespace haustra::kernels::cuda
