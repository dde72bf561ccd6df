// The weights of the blur on tensor cores: no device is needed.
#include "kernels/cuda/band_weights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace haustra::testing {
namespace {

using namespace kernels;        // NOLINT: constants of the scale space
using namespace kernels::cuda;  // NOLINT

constexpr BandSource kSources[] = {BandSource::kEnlargedGrey, BandSource::kGrey, BandSource::kPlane};
constexpr int kOne = 1 << 16;

// Source pixels to a pixel of the level.
double SpacingOf(BandSource source) { return source == BandSource::kEnlargedGrey ? 0.5 : 1.0; }

struct Row {
  int sum = 0;
  double mean = 0.0;      // source rows
  double variance = 0.0;  // level pixels
  bool are_exact = true;  // as half-precision floats
};

Row Measure(BandSource source, int level, int row) {
  Row result;
  double moments[2] = {};
  for (int s = 0; s < 16 * BandSteps(source); ++s) {
    const int weight = BandWeight(source, level, row, s);
    result.sum += weight;
    moments[0] += static_cast<double>(weight) * s / kOne;
    moments[1] += static_cast<double>(weight) * s * s / kOne;
    int significant = weight;
    while (significant > 0 && significant % 2 == 0) significant /= 2;
    result.are_exact &= weight >= 0 && significant < 2048;
  }
  result.mean = moments[0];
  result.variance = (moments[1] - moments[0] * moments[0]) / (SpacingOf(source) * SpacingOf(source));
  return result;
}

TEST(BandWeights, AddUpToOneAndAreExactAsHalf) {
  for (const BandSource source : kSources) {
    for (int level = 0; level < kNumLevels; ++level) {
      for (int row = 0; row < 16; ++row) {
        const Row measured = Measure(source, level, row);
        EXPECT_EQ(measured.sum, kOne) << static_cast<int>(source) << ", level " << level << ", row " << row;
        EXPECT_TRUE(measured.are_exact) << static_cast<int>(source) << ", level " << level << ", row " << row;
      }
    }
  }
}

// As the kernels get them: no weight is too large for a half (a level that is its source has a weight of 1).
TEST(BandWeights, FragmentsHoldTheWeights) {
  const auto half = [](std::uint32_t bits) {
    const int exponent = static_cast<int>(bits >> 10 & 31);
    EXPECT_NE(exponent, 31) << "infinite";
    return exponent == 0 ? 0.0 : std::ldexp(1024.0 + (bits & 1023), exponent - 25);
  };
  for (const BandSource source : kSources) {
    const BandWeights weights = MakeBandWeights(source);
    for (int level = 0; level < kNumLevels; ++level) {
      // Lanes 0 to 3 hold row 0 from the left in words 0 and 2, and column 0 from the right in words 0 and 1.
      double sum_of_row = 0.0;
      double sum_of_column = 0.0;
      for (int step = 0; step < BandSteps(source); ++step) {
        for (int lane = 0; lane < 4; ++lane) {
          const std::uint32_t* row = weights.rows[level][step][lane].words;
          const std::uint32_t* column = weights.columns[level][step][lane].words;
          for (const std::uint32_t two : {row[0], row[2]}) sum_of_row += half(two & 0xffff) + half(two >> 16);
          for (const std::uint32_t two : {column[0], column[1]}) sum_of_column += half(two & 0xffff) + half(two >> 16);
        }
      }
      EXPECT_EQ(sum_of_row, kBandScale) << static_cast<int>(source) << ", level " << level;
      EXPECT_EQ(sum_of_column, kBandScale) << static_cast<int>(source) << ", level " << level;
    }
  }
}

TEST(BandWeights, RowsAreCentredAndBlurredAlike) {
  for (const BandSource source : kSources) {
    for (int level = 0; level < kNumLevels; ++level) {
      const Row first = Measure(source, level, 0);
      for (int row = 0; row < 16; ++row) {
        const Row measured = Measure(source, level, row);
        EXPECT_NEAR(measured.mean, BandMargin(source) + row * SpacingOf(source), 1e-9);
        EXPECT_NEAR(measured.variance, first.variance, 0.002 * first.variance + 1e-9)
            << static_cast<int>(source) << ", level " << level << ", row " << row;
      }
    }
  }
}

// The blur of a level is that of its place in the octave, less that of the source; kernels that are cut off have a
// little less. To enlarge by two takes means of neighbours: 0.5 of variance in pixels of octave -1, and so an eighth in
// those of octave 0.
TEST(BandWeights, BlurIsThatOfTheLevel) {
  for (const BandSource source : kSources) {
    for (int level = 0; level < kNumLevels; ++level) {
      const double sigma = kBaseSigma * std::exp2(static_cast<double>(level) / kScalesPerOctave);
      const double sigma_of_source = source == BandSource::kPlane          ? kBaseSigma
                                     : source == BandSource::kEnlargedGrey ? 2 * kInputSigma
                                                                           : kInputSigma;
      const double of_enlargement = source == BandSource::kPlane ? 0.0 : source == BandSource::kGrey ? 0.125 : 0.5;
      const double expected = sigma * sigma - sigma_of_source * sigma_of_source + of_enlargement;
      const double variance = Measure(source, level, 0).variance;
      EXPECT_NEAR(variance, expected, 0.05 * expected) << static_cast<int>(source) << ", level " << level;
    }
  }
}

TEST(BandWeights, ReductionsAddUpToOneAndBlurAsTheirOctave) {
  for (const int factor : {2, 4}) {
    for (const bool from_grey : {true, false}) {
      const std::vector<float> weights = WeightsOfReduction(factor, from_grey);
      ASSERT_EQ(static_cast<int>(weights.size()), ReductionRadius(factor) + 1);
      double sum = weights[0];
      double variance = 0.0;
      for (std::size_t j = 1; j < weights.size(); ++j) {
        sum += 2.0 * weights[j];
        variance += 2.0 * weights[j] * j * j;
      }
      const double sigma_of_source = from_grey ? kInputSigma : kBaseSigma;
      const double expected = std::pow(kBaseSigma * factor, 2) - sigma_of_source * sigma_of_source;
      EXPECT_NEAR(sum, 1.0, 1e-6);
      EXPECT_NEAR(variance, expected, 0.05 * expected) << factor << ", " << from_grey;
    }
  }
}

}  // namespace
}  // namespace haustra::testing
