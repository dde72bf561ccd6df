#include "engine/geometry/rng.h"

#include <gtest/gtest.h>

#include <array>
#include <set>

namespace haustra {
namespace {

TEST(Rng, ReferenceSequenceOfPcg32) {
  // First outputs of pcg32 for seed 42, sequence 54: the demonstration output of the algorithm's author.
  Rng rng(42, 54);
  const std::array<std::uint32_t, 6> expected = {0xa15c02b7, 0x7b47f409, 0xba1d3330,
                                                 0x83d2f293, 0xbfa4784b, 0xcbed606e};
  for (const std::uint32_t value : expected) EXPECT_EQ(rng.Next(), value);
}

TEST(Rng, SeedAloneDecidesTheSequence) {
  Rng a(3), b(3), c(4);
  bool differs = false;
  for (int i = 0; i < 100; ++i) {
    const std::uint32_t value = a.Next();
    EXPECT_EQ(value, b.Next());
    differs = differs || value != c.Next();
  }
  EXPECT_TRUE(differs);
}

TEST(Rng, UniformIntHasNoModuloBias) {
  // Three quarters of 2^32: with a modulo the lower third would come up twice as often.
  Rng rng(11);
  const std::uint32_t bound = 3u << 30;
  int low = 0;
  constexpr int kDraws = 60000;
  for (int i = 0; i < kDraws; ++i) {
    const std::uint32_t value = rng.UniformInt(bound);
    ASSERT_LT(value, bound);
    if (value < bound / 3) ++low;
  }
  EXPECT_NEAR(low, kDraws / 3, 600);  // five sigma
}

TEST(Rng, UniformIntReachesEveryValueOfASmallRange) {
  Rng rng(1);
  std::array<int, 5> counts{};
  for (int i = 0; i < 5000; ++i) ++counts[rng.UniformInt(5)];
  for (const int count : counts) EXPECT_NEAR(count, 1000, 150);
  EXPECT_EQ(rng.UniformInt(1), 0u);
}

TEST(Rng, UniformLiesInTheHalfOpenUnitInterval) {
  Rng rng(5);
  double sum = 0.0;
  for (int i = 0; i < 10000; ++i) {
    const double value = rng.Uniform();
    ASSERT_GE(value, 0.0);
    ASSERT_LT(value, 1.0);
    sum += value;
  }
  EXPECT_NEAR(sum / 10000, 0.5, 0.02);
}

TEST(Rng, SamplesAreDistinctEvenWhenTheyExhaustTheRange) {
  Rng rng(9);
  for (int trial = 0; trial < 100; ++trial) {
    std::array<int, 5> sample;
    rng.SampleDistinct(5, sample);
    EXPECT_EQ(std::set<int>(sample.begin(), sample.end()), (std::set<int>{0, 1, 2, 3, 4}));
  }
}

}  // namespace
}  // namespace haustra
