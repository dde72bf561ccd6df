#include "hal/core/median.h"

#include <gtest/gtest.h>

#include <vector>

namespace haustra {
namespace {

double Upper(std::vector<double> values) { return UpperMedian(std::span<double>(values)); }
double Mean(std::vector<double> values) { return MeanMedian(std::span<double>(values)); }

TEST(Median, OfAnOddNumberIsTheOneInTheMiddle) {
  EXPECT_EQ(Upper({9, 1, 5}), 5.0);
  EXPECT_EQ(Mean({9, 1, 5}), 5.0);
  EXPECT_EQ(Upper({3}), 3.0);
  EXPECT_EQ(Mean({3}), 3.0);
}

TEST(Median, OfAnEvenNumberIsTheUpperOfTheMiddleTwoOrTheirMean) {
  EXPECT_EQ(Upper({9, 1, 5, 2}), 5.0);
  EXPECT_EQ(Mean({9, 1, 5, 2}), 3.5);
  EXPECT_EQ(Upper({2, 1}), 2.0);
  EXPECT_EQ(Mean({2, 1}), 1.5);
}

TEST(Median, OfNothingIsZero) {
  EXPECT_EQ(Upper({}), 0.0);
  EXPECT_EQ(Mean({}), 0.0);
}

}  // namespace
}  // namespace haustra
