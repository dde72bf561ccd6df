// Drops on the lens, seen on a picture whose light says where it comes from: what they bend, how long they stay.
#include "tools/render/lens_drops.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

constexpr int kWidth = 320, kHeight = 240;

// Red and green hold the place, blue is even.
LinearImage Places() {
  LinearImage image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      float* pixel = image.pixel(x, y);
      pixel[0] = static_cast<float>(x) / kWidth;
      pixel[1] = static_cast<float>(y) / kHeight;
      pixel[2] = 1.0f;
    }
  }
  return image;
}

class LensDropsTest : public testing::Test {
 protected:
  LensDrops Drops(int count, std::uint64_t seed) const {
    LensDropsStyle style;
    style.count = count;
    style.size_percent = 20.0;
    return LensDrops(style, window_, seed);
  }
  // Wholly in the middle of the picture, and neither coming nor going.
  static bool IsWholeAt(const LensDrop& drop) {
    const float reach = drop.reach() + 0.15f;
    return drop.amount == 1.0f && drop.x > reach && drop.y > reach && drop.x < 1.33f - reach && drop.y < 1.0f - reach;
  }

  WindowMask window_{kWidth, kHeight};
};

// The pixels that a drop changes; their middle and their number.
struct Patch {
  double x = 0.0, y = 0.0;
  int count = 0;
};
Patch Changed(const LensDrops& drops, double time_s) {
  LinearImage image = Places();
  const LinearImage before = image;
  drops.Apply(time_s, &image);
  Patch patch;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (std::equal(image.pixel(x, y), image.pixel(x, y) + 3, before.pixel(x, y))) continue;
      patch.x += x;
      patch.y += y;
      ++patch.count;
    }
  }
  patch.x /= std::max(patch.count, 1);
  patch.y /= std::max(patch.count, 1);
  return patch;
}

TEST_F(LensDropsTest, EveryPlaceInADropShowsOneNearerToItsMiddleAndTheRestStays) {
  int num_judged = 0;
  for (std::uint64_t seed = 1; seed < 80; ++seed) {
    const LensDrops drops = Drops(1, seed);
    const LensDrop drop = drops.At(0, 5.0);
    if (!IsWholeAt(drop)) continue;
    ++num_judged;
    LinearImage image = Places();
    const LinearImage before = image;
    drops.Apply(5.0, &image);
    const float cx = drop.x * kHeight, cy = drop.y * kHeight;
    // The defocus averages over a disc that is symmetric: the place in its middle is shown.
    constexpr float kSlackPx = 0.4f;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float* pixel = image.pixel(x, y);
        const auto px = static_cast<float>(x), py = static_cast<float>(y);
        const float distance = std::hypot(px - cx, py - cy);
        if (distance > 1.2f * drop.radius * kHeight) {
          ASSERT_TRUE(std::equal(pixel, pixel + 3, before.pixel(x, y))) << seed << " " << x << " " << y;
          continue;
        }
        if (window_.coverage(x, y) <= 0.0f) continue;
        const float sx = pixel[0] / pixel[2] * kWidth, sy = pixel[1] / pixel[2] * kHeight;
        ASSERT_LE(std::hypot(sx - cx, sy - cy), distance + kSlackPx);
        // Along the line to the middle.
        ASSERT_LT(std::abs((sx - cx) * (py - cy) - (sy - cy) * (px - cx)), kSlackPx * (distance + 1.0f));
      }
    }
    // In the middle it is larger by one over this.
    const int x = static_cast<int>(std::lround(cx)), y = static_cast<int>(std::lround(cy));
    const float* right = image.pixel(x + 3, y);
    const float* left = image.pixel(x - 3, y);
    EXPECT_NEAR((right[0] / right[2] - left[0] / left[2]) * kWidth / 6.0f, 0.45f, 0.06f);
  }
  EXPECT_GT(num_judged, 8);
}

TEST_F(LensDropsTest, LightIsNeitherLostNorWon) {
  LinearImage image = Places();
  for (std::uint64_t seed = 1; seed < 6; ++seed) Drops(10, seed).Apply(3.0, &image);
  double sum = 0.0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) sum += image.pixel(x, y)[2];
  }
  EXPECT_NEAR(sum / (kWidth * kHeight), 1.0, 0.01);
}

TEST_F(LensDropsTest, DropStaysForManySecondsAndCreepsDown) {
  int num_judged = 0;
  for (std::uint64_t seed = 1; seed < 80; ++seed) {
    const LensDrops drops = Drops(1, seed);
    // Ten seconds of one stay of at least fourteen.
    if (!IsWholeAt(drops.At(0, 2.0)) || !IsWholeAt(drops.At(0, 12.0))) continue;
    const Patch early = Changed(drops, 2.0), late = Changed(drops, 12.0);
    const double moved = std::hypot(late.x - early.x, late.y - early.y);
    if (moved > 40.0) continue;  // another drop
    ++num_judged;
    EXPECT_GT(late.y, early.y + 1.0) << seed;
    EXPECT_LT(moved, 10.0 * 0.0035 * kHeight + 1.0) << seed;
    EXPECT_NEAR(late.count, early.count, 0.05 * early.count + 10.0);
  }
  EXPECT_GT(num_judged, 4);
}

TEST_F(LensDropsTest, NumberAndSizeAreThoseOfTheStyle) {
  double diameter = 0.0, covered = 0.0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const LensDrops drops = Drops(10, seed);
    for (int i = 0; i < 10; ++i) diameter += 2.0 * drops.At(i, 7.0).radius / 400.0;
    covered += Changed(Drops(1, seed), 7.0).count / (40.0 * kHeight * kHeight);
  }
  EXPECT_NEAR(diameter, 0.20, 0.012);
  // Discs of that mean diameter; some hang over the rim of the window.
  EXPECT_GT(covered, 0.6 * 3.14 * 0.01);
  EXPECT_LT(covered, 1.5 * 3.14 * 0.01);
  LinearImage image = Places();
  Drops(0, 1).Apply(7.0, &image);
  EXPECT_EQ(image.rgb, Places().rgb);
}

TEST_F(LensDropsTest, WhatIsOutOfRangeIsNamed) {
  LensDropsStyle style;
  EXPECT_TRUE(style.Validate().ok());
  style.count = 41;
  EXPECT_FALSE(style.Validate().ok());
  style.count = 40;
  style.size_percent = 41.0;
  EXPECT_NE(style.Validate().message().find("size"), std::string::npos);
}

}  // namespace
}  // namespace haustra::render
