#include "capture/number.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace haustra::capture::internal {
namespace {

using ::testing::HasSubstr;

TEST(ParseDouble, TakesTheWholeText) {
  EXPECT_EQ(ParseDouble("-1.5e-3").value(), -1.5e-3);
  EXPECT_EQ(ParseDouble("+2.").value(), 2.0);
  for (const char* bad : {"", "1.2.3", "1,5", "1 2", "abc", "0x10", "1e", "--1", "+-1", "+"}) {
    const Result<double> number = ParseDouble(bad);
    EXPECT_EQ(number.code(), StatusCode::kInvalidArgument) << bad;
    EXPECT_THAT(number.status().message(), HasSubstr("is not a number")) << bad;
  }
}

TEST(ParseDouble, RefusesWhatIsNotFinite) {
  for (const char* bad : {"nan", "NaN", ".nan", "-.inf", "inf", "Infinity", ".Inf"}) {
    EXPECT_THAT(ParseDouble(bad).status().message(), HasSubstr("is not finite")) << bad;
  }
  EXPECT_THAT(ParseDouble("1e999").status().message(), HasSubstr("out of range"));
}

TEST(ParseInteger, RefusesFractionsAndOverflow) {
  EXPECT_EQ(ParseInteger("1403636579763555584").value(), 1403636579763555584);
  EXPECT_EQ(ParseInteger("-3").value(), -3);
  for (const char* bad : {"", "1.0", "1e3", "12a", "99999999999999999999"}) {
    EXPECT_EQ(ParseInteger(bad).code(), StatusCode::kInvalidArgument) << bad;
  }
}

TEST(ParseSeconds, KeepsEveryNanosecond) {
  EXPECT_EQ(ParseSeconds("0.033333").value(), 33'333'000);
  EXPECT_EQ(ParseSeconds("1403636579.763555527").value(), 1'403'636'579'763'555'527);
  EXPECT_EQ(ParseSeconds("7").value(), 7'000'000'000);
  EXPECT_EQ(ParseSeconds("7.").value(), 7'000'000'000);
  EXPECT_EQ(ParseSeconds(".5").value(), 500'000'000);
  EXPECT_EQ(ParseSeconds("-0.25").value(), -250'000'000);
  EXPECT_EQ(ParseSeconds("0.0000000015").value(), 2);
  EXPECT_EQ(ParseSeconds("0.99999999951").value(), 1'000'000'000);
  EXPECT_EQ(ParseSeconds("1.5e1").value(), 15'000'000'000);
}

TEST(ParseSeconds, RefusesWhatIsNoTime) {
  for (const char* bad : {"", ".", "-", "nan", "1.2.3", "0.1 s", "99999999999999", "1e30"}) {
    EXPECT_EQ(ParseSeconds(bad).code(), StatusCode::kInvalidArgument) << bad;
  }
}

TEST(FormatDouble, ReadsBackAsTheSameNumber) {
  for (const double value : {0.1, -8.12770624150226e-4, 1.0 / 3.0, 398.2, 0.0, 1e300}) {
    EXPECT_EQ(ParseDouble(FormatDouble(value)).value(), value);
  }
}

TEST(FormatSeconds, HasNineDecimals) {
  EXPECT_EQ(FormatSeconds(1'040'000'000), "1.040000000");
  EXPECT_EQ(FormatSeconds(-250'000'000), "-0.250000000");
  EXPECT_EQ(FormatSeconds(-1'250'000'000), "-1.250000000");
}

}  // namespace
}  // namespace haustra::capture::internal
