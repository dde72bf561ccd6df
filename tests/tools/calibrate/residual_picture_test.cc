#include "tools/calibrate/residual_picture.h"

#include <gtest/gtest.h>

namespace haustra {
namespace {

TEST(ResidualPicture, ShowsWhereResidualsAreLargeAndWhereThereAreNone) {
  std::vector<calibration::Residual> residuals;
  for (int i = 0; i < 10; ++i) {
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    residuals.push_back({{15.0, 15.0}, {0.1 * sign, 0.0}});
    residuals.push_back({{105.0, 15.0}, {3.0 * sign, 0.0}});
  }
  residuals.push_back({{-5.0, 1e9}, {1.0, 1.0}});  // outside: left out
  const Image picture = DrawResiduals(residuals, 240, 120);
  ASSERT_EQ(picture.width(), 240);
  ASSERT_EQ(picture.height(), 120);
  const auto pixel = [&](int x, int y) { return picture.row(y) + 3 * x; };
  EXPECT_GT(pixel(11, 11)[0], pixel(11, 11)[2]);    // blue
  EXPECT_GT(pixel(101, 11)[2], pixel(101, 11)[0]);  // red
  EXPECT_EQ(pixel(201, 101)[0], pixel(201, 101)[2]);
}

TEST(ResidualPicture, DrawsWhatResidualsAgreeOnAsAnArrow) {
  std::vector<calibration::Residual> residuals(10, {{125.0, 65.0}, {0.4, 0.0}});
  const Image picture = DrawResiduals(residuals, 240, 120);
  EXPECT_EQ(picture.row(65)[3 * 140], 255);  // twenty pixels to the right
  EXPECT_NE(picture.row(65)[3 * 100], 255);
}

}  // namespace
}  // namespace haustra
