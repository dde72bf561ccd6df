#include "hal/core/percentile.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace haustra {
namespace {

TEST(Percentile, IsTheSmallestValueThatSoManyDoNotExceed) {
  std::vector<int> values(1000);
  std::iota(values.begin(), values.end(), 1);
  const std::span<const int> sorted(values);
  EXPECT_EQ(Percentile(sorted, 500), 500);
  EXPECT_EQ(Percentile(sorted, 990), 990);
  EXPECT_EQ(Percentile(sorted, 999), 999);
  EXPECT_EQ(Percentile(sorted, 1000), 1000);
}

TEST(Percentile, OfFewValuesRoundsTheRankUp) {
  const std::vector<double> values{1, 2, 3};
  EXPECT_EQ(Percentile(std::span<const double>(values), 0), 1.0);
  EXPECT_EQ(Percentile(std::span<const double>(values), 500), 2.0);
  EXPECT_EQ(Percentile(std::span<const double>(values), 990), 3.0);
}

TEST(Percentile, OfNothingIsZero) { EXPECT_EQ(Percentile(std::span<const double>(), 500), 0.0); }

}  // namespace
}  // namespace haustra
