#include "tools/evaluate/statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace haustra::evaluate {
namespace {

TEST(Median, IsTheMiddleOrTheMeanOfTheMiddleTwo) {
  EXPECT_EQ(Median({3.0}), 3.0);
  EXPECT_EQ(Median({9.0, 1.0, 5.0}), 5.0);
  EXPECT_EQ(Median({9.0, 1.0, 5.0, 2.0}), 3.5);
}

TEST(FindPercentiles, NothingForNoValues) { EXPECT_FALSE(FindPercentiles({}).has_value()); }

TEST(FindPercentiles, OneValueIsAllOfThem) {
  const Percentiles p = *FindPercentiles({7.0});
  EXPECT_EQ(p.p50, 7.0);
  EXPECT_EQ(p.p999, 7.0);
  EXPECT_EQ(p.max, 7.0);
}

TEST(FindPercentiles, NearestRankOfAThousand) {
  std::vector<double> values(1000);
  std::iota(values.begin(), values.end(), 1.0);
  std::shuffle(values.begin(), values.end(), std::mt19937(3));
  const Percentiles p = *FindPercentiles(values);
  EXPECT_EQ(p.p50, 500.0);
  EXPECT_EQ(p.p99, 990.0);
  EXPECT_EQ(p.p999, 999.0);
  EXPECT_EQ(p.max, 1000.0);
}

TEST(FindPercentiles, FewValuesRoundTheRankUp) {
  const Percentiles p = *FindPercentiles({1.0, 2.0, 3.0, 4.0, 5.0});
  EXPECT_EQ(p.p50, 3.0);
  EXPECT_EQ(p.p99, 5.0);
}

TEST(FindSpread, IsThatOfASample) {
  const Spread spread = FindSpread({2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0});
  EXPECT_DOUBLE_EQ(spread.mean, 5.0);
  EXPECT_DOUBLE_EQ(spread.deviation, std::sqrt(32.0 / 7.0));
  EXPECT_EQ(spread.min, 2.0);
  EXPECT_EQ(spread.max, 9.0);
  EXPECT_EQ(spread.count, 8u);
}

TEST(FindSpread, OneRunHasNone) { EXPECT_EQ(FindSpread({0.25}).deviation, 0.0); }

}  // namespace
}  // namespace haustra::evaluate
