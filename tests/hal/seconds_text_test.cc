#include "hal/core/seconds_text.h"

#include <gtest/gtest.h>

namespace haustra {
namespace {

TEST(SecondsText, IsToTheMillisecond) {
  EXPECT_EQ(SecondsText(TimePoint(Duration(1'000'220'400'000))), "1000.220");
  EXPECT_EQ(SecondsText(TimePoint()), "0.000");
  EXPECT_EQ(SecondsText(TimePoint(Duration(-1'500'000'000))), "-1.500");
}

TEST(SecondsText, HasRoomForAnyTime) {
  EXPECT_EQ(SecondsText(TimePoint::max()), "9223372036.855");
  EXPECT_EQ(SecondsText(TimePoint::min()), "-9223372036.855");
}

}  // namespace
}  // namespace haustra
