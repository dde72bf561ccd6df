#include "capture/side_by_side.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "capture/image.h"
#include "capture/image_transform.h"
#include "capture/yuv.h"
#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

constexpr int kWidth = 400, kHeight = 240;  // of a half

double LatticeValue(int x, int y, std::uint32_t seed) {
  std::uint32_t bits = static_cast<std::uint32_t>(x) * 374761393u + static_cast<std::uint32_t>(y) * 668265263u + seed;
  bits = (bits ^ (bits >> 13)) * 1274126177u;
  return static_cast<double>((bits ^ (bits >> 16)) & 0xffffu) / 65535.0;
}

// Blobs of about `size` pixels, 0 to 1.
double BlobsAt(double x, double y, double size, std::uint32_t seed) {
  const double u = x / size, v = y / size;
  const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
  const double a = u - i, b = v - j;
  return (1 - b) * ((1 - a) * LatticeValue(i, j, seed) + a * LatticeValue(i + 1, j, seed)) +
         b * ((1 - a) * LatticeValue(i, j + 1, seed) + a * LatticeValue(i + 1, j + 1, seed));
}

int WallAt(double x, double y, std::uint32_t seed) {
  return static_cast<int>(40 + 90 * BlobsAt(x, y, 23, seed) + 60 * BlobsAt(x, y, 9, seed + 1));
}

// The second half sees wall `other`, which at 0 is the same, from aside: shifted by 6 to 26 pixels as its depth varies,
// two rows lower, darker, and with noise of its own.
Image TwoHalves(bool is_beside, std::uint32_t other) {
  Image image(is_beside ? 2 * kWidth : kWidth, is_beside ? kHeight : 2 * kHeight, PixelFormat::kGrey8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double shift = 16 + 10 * std::sin(0.01 * x) * std::cos(0.013 * y);
      const int noise = static_cast<int>(8 * LatticeValue(x, y, 99));
      image.row(y)[x] = static_cast<std::uint8_t>(WallAt(x, y, 7));
      image.row(is_beside ? y : kHeight + y)[is_beside ? kWidth + x : x] =
          static_cast<std::uint8_t>(WallAt(x + shift, y - 2, 7 + other) * 8 / 10 + noise);
    }
  }
  return image;
}

bool AreTwo(const Image& image, Halves halves) {
  HalvesMatch match = MatchHalves(image.view(), halves);
  match += match;
  return AreTwoViews(match);
}

bool IsAny(const Image& image) { return AreTwo(image, Halves::kLeftAndRight) || AreTwo(image, Halves::kTopAndBottom); }

TEST(SideBySide, TwoViewsOfOneSceneAreFoundWhereTheyAre) {
  const Image beside = TwoHalves(true, 0), above = TwoHalves(false, 0);
  EXPECT_TRUE(AreTwo(beside, Halves::kLeftAndRight));
  EXPECT_FALSE(AreTwo(beside, Halves::kTopAndBottom));
  EXPECT_TRUE(AreTwo(above, Halves::kTopAndBottom));
  EXPECT_FALSE(AreTwo(above, Halves::kLeftAndRight));
}

TEST(SideBySide, InColourAsInGrey) {
  const Image grey = TwoHalves(true, 0);
  Image colour(grey.width(), grey.height(), PixelFormat::kBgr8);
  for (int y = 0; y < grey.height(); ++y) {
    for (int i = 0; i < 3 * grey.width(); ++i) colour.row(y)[i] = grey.row(y)[i / 3];
  }
  EXPECT_TRUE(AreTwo(colour, Halves::kLeftAndRight));
}

TEST(SideBySide, TwoScenesAreNot) { EXPECT_FALSE(IsAny(TwoHalves(true, 40))); }

TEST(SideBySide, OneViewIsNotWhateverItsSize) {
  for (const auto& [width, height] : {std::pair{800, 240}, {192, 192}, {120, 300}, {64, 48}, {7, 5}, {1, 1}}) {
    Image image(width, height, PixelFormat::kGrey8);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) image.row(y)[x] = static_cast<std::uint8_t>(WallAt(x, y, 3));
    }
    EXPECT_FALSE(IsAny(image)) << width << "x" << height;
  }
}

TEST(SideBySide, AMirroredSceneIsNot) {
  Image image(2 * kWidth, kHeight, PixelFormat::kGrey8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < 2 * kWidth; ++x) {
      image.row(y)[x] = static_cast<std::uint8_t>(WallAt(std::abs(x - kWidth), y, 7));
    }
  }
  EXPECT_FALSE(IsAny(image));
}

// Both halves have the same edges, and nothing else.
TEST(SideBySide, BarsAroundAFlatSceneAreNot) {
  Image image(2 * kWidth, kHeight, PixelFormat::kGrey8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < 2 * kWidth; ++x) {
      image.row(y)[x] = y < 40 || y >= 200 ? 16 : static_cast<std::uint8_t>(120 + x / 20);
    }
  }
  EXPECT_FALSE(IsAny(image));
}

// What repeats is everywhere.
TEST(SideBySide, AGridIsNot) {
  Image image(2 * kWidth, kHeight, PixelFormat::kGrey8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < 2 * kWidth; ++x) {
      image.row(y)[x] = static_cast<std::uint8_t>(x / 20 % 2 == y / 20 % 2 ? 200 : 40);
    }
  }
  EXPECT_FALSE(IsAny(image));
}

TEST(SideBySide, NothingIsSaidOfFlatAndEmptyPictures) {
  EXPECT_EQ(MatchHalves(FlatImage(640, 480, PixelFormat::kBgr8, 90).view(), Halves::kLeftAndRight).num_blocks, 0);
  EXPECT_EQ(MatchHalves(Image().view(), Halves::kTopAndBottom).num_blocks, 0);
  EXPECT_FALSE(AreTwoViews({}));
  EXPECT_FALSE(AreTwoViews({39, 39, 0})) << "too few";
}

}  // namespace
}  // namespace haustra
