#include "tools/render/window_mask.h"

#include <gtest/gtest.h>

namespace haustra::render {
namespace {

TEST(WindowMask, IsAnOctagon) {
  const WindowMask window(720, 540);
  const ImageView mask = window.mask();
  ASSERT_EQ(mask.width, 720);
  ASSERT_EQ(mask.height, 540);
  EXPECT_EQ(mask.row(270)[360], 255);
  // The four corners are cut, the middles of the four sides are not.
  for (const auto& [x, y] : {std::pair{10, 10}, {709, 10}, {10, 529}, {709, 529}, {50, 50}})
    EXPECT_EQ(mask.row(y)[x], 0);
  for (const auto& [x, y] : {std::pair{360, 12}, {360, 527}, {12, 270}, {707, 270}}) EXPECT_EQ(mask.row(y)[x], 255);
}

TEST(WindowMask, IsSymmetric) {
  const WindowMask window(675, 540);
  const ImageView mask = window.mask();
  for (int y = 0; y < 540; y += 3) {
    for (int x = 0; x < 675; x += 3) {
      EXPECT_EQ(mask.row(y)[x], mask.row(y)[674 - x]);
      EXPECT_EQ(mask.row(y)[x], mask.row(539 - y)[x]);
    }
  }
}

TEST(WindowMask, MaskedPixelsAreWholePicture) {
  const WindowMask window(320, 240);
  int num_inside = 0;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      const bool is_inside = window.mask().row(y)[x] == 255;
      num_inside += is_inside ? 1 : 0;
      EXPECT_EQ(is_inside, window.coverage(x, y) >= 1.0f);
    }
  }
  EXPECT_GT(num_inside, 320 * 240 * 8 / 10);
}

}  // namespace
}  // namespace haustra::render
