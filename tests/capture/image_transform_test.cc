#include "capture/image_transform.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::ElementsAre;

TEST(HalveImage, AveragesEachBlockToNearest) {
  Image image(4, 2, PixelFormat::kGrey8);
  const std::uint8_t upper[] = {0, 1, 255, 255};
  const std::uint8_t lower[] = {0, 1, 255, 254};
  std::copy_n(upper, 4, image.row(0));
  std::copy_n(lower, 4, image.row(1));
  Image half;
  HalveImage(image.view(), &half);
  EXPECT_EQ(half.width(), 2);
  EXPECT_EQ(half.height(), 1);
  // Means 0.5 and 254.75.
  EXPECT_THAT(PixelsOf(half.view()), ElementsAre(1, 255));
}

TEST(HalveImage, KeepsChannelsApart) {
  Image image(2, 2, PixelFormat::kBgr8);
  for (int y = 0; y < 2; ++y) {
    const std::uint8_t row[] = {10, 100, 200, 30, 120, 220};
    std::copy_n(row, 6, image.row(y));
  }
  Image half;
  HalveImage(image.view(), &half);
  EXPECT_THAT(PixelsOf(half.view()), ElementsAre(20, 110, 210));
}

TEST(HalveImage, OddRowAndColumnAreLeftOut) {
  Image half;
  HalveImage(RampImage(7, 5, PixelFormat::kBgr8).view(), &half);
  EXPECT_EQ(half.width(), 3);
  EXPECT_EQ(half.height(), 2);
}

TEST(HalveImage, MovesALinearRampAsHalvedCalibrationSays) {
  // The pixel x of a ramp has the value 4 x; a half pixel x' sees the scene at x = 2 x' + 0.5, where the ramp is 8 x'
  // + 2.
  Image ramp(32, 4, PixelFormat::kGrey8);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 32; ++x) ramp.row(y)[x] = static_cast<std::uint8_t>(4 * x);
  }
  Image half;
  HalveImage(ramp.view(), &half);
  for (int x = 0; x < 16; ++x) EXPECT_EQ(half.row(1)[x], 8 * x + 2);
}

TEST(HalveMask, IsInsideOnlyWhereAllFourAre) {
  Image mask = FlatImage(6, 2, PixelFormat::kGrey8, 255);
  mask.row(1)[3] = 0;
  mask.row(0)[4] = 127;
  Image half;
  HalveMask(mask.view(), &half);
  EXPECT_THAT(PixelsOf(half.view()), ElementsAre(255, 0, 0));
}

TEST(ToGrey, WeighsChannelsAsJpegDoes) {
  Image image(4, 1, PixelFormat::kBgr8);
  const std::uint8_t bgr[] = {255, 255, 255, 255, 0, 0, 0, 255, 0, 0, 0, 255};
  std::copy_n(bgr, 12, image.row(0));
  Image grey;
  ToGrey(image.view(), &grey);
  EXPECT_THAT(PixelsOf(grey.view()), ElementsAre(255, 29, 150, 76));
}

TEST(CopyImage, CopiesAViewWithAnotherPitch) {
  const std::uint8_t pixels[] = {1, 2, 99, 99, 3, 4, 99, 99};
  Image copy;
  CopyImage({.data = pixels, .width = 2, .height = 2, .pitch_bytes = 4, .format = PixelFormat::kGrey8}, &copy);
  EXPECT_THAT(PixelsOf(copy.view()), ElementsAre(1, 2, 3, 4));
}

}  // namespace
}  // namespace haustra
