// Depths of walls that are known by construction, with the faults that windows at the edges of folds make.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/geometry/rng.h"
#include "engine/surface/depth_median.h"

namespace haustra {
namespace {

constexpr int kCellPx = 4;

// A picture and a depth of one scene, cell by cell.
struct MedianScene {
  MedianScene(int width, int height, const std::function<double(int, int)>& grey_of,
              const std::function<double(int, int)>& range_of, const std::function<int(int, int)>& confidence_of)
      : pixels(std::size_t(width) * height * kCellPx * kCellPx), depth(width, height) {
    picture.format = PixelFormat::kGrey8;
    picture.width = width * kCellPx;
    picture.height = height * kCellPx;
    picture.pitch_bytes = picture.width;
    depth.Clear(0.1);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        for (int v = 0; v < kCellPx; ++v) {
          for (int u = 0; u < kCellPx; ++u) {
            pixels[std::size_t(y * kCellPx + v) * picture.width + x * kCellPx + u] =
                static_cast<std::uint8_t>(std::lround(grey_of(x, y)));
          }
        }
        if (range_of(x, y) > 0.0) depth.Set(y * width + x, 1.0 / range_of(x, y), confidence_of(x, y));
      }
    }
    picture.data = pixels.data();
  }

  void Apply() { DepthMedian(depth.width(), depth.height()).Apply(picture, kCellPx, &depth); }
  double RangeAt(int x, int y) const { return depth.range_mu(y * depth.width() + x); }

  std::vector<std::uint8_t> pixels;
  ImageView picture;
  DepthMap depth;
};

TEST(DepthMedian, AStripBehindAFoldTakesTheRangeOfTheWallThatIsAsDark) {
  // A bright fold on the left, twice as far a wall on the right. Two columns of the wall have the range of the fold,
  // and are less sure.
  MedianScene scene(
      40, 20, [](int x, int) { return x < 20 ? 200.0 : 50.0; }, [](int x, int) { return x < 22 ? 1.0 : 2.0; },
      [](int x, int) { return x == 20 || x == 21 ? 100 : 200; });
  scene.Apply();
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 40; ++x) EXPECT_NEAR(scene.RangeAt(x, y), x < 20 ? 1.0 : 2.0, 0.01) << x << ", " << y;
  }
}

TEST(DepthMedian, AnInclinedWallStays) {
  // One per cent farther with each cell, lit by the scope.
  const auto range = [](int x, int) { return std::pow(1.01, x); };
  MedianScene scene(
      50, 20, [&](int x, int y) { return 220.0 / std::pow(range(x, y), 2.0); }, range, [](int, int) { return 150; });
  scene.Apply();
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 50; ++x) {
      // At the border there are neighbours on one side only.
      const double tolerance = x < 4 || x > 45 ? 0.02 : 0.006;
      EXPECT_NEAR(scene.RangeAt(x, y) / range(x, y), 1.0, tolerance) << x << ", " << y;
    }
  }
}

TEST(DepthMedian, FewConfidentDepthsOutweighManyThatAreNot) {
  const auto is_sure = [](int x, int y) { return std::abs(x - 10) <= 2 && std::abs(y - 10) <= 2; };
  MedianScene scene(
      21, 21, [](int, int) { return 100.0; }, [&](int x, int y) { return is_sure(x, y) ? 1.0 : 3.0; },
      [&](int x, int y) { return is_sure(x, y) ? 255 : 20; });
  scene.Apply();
  EXPECT_NEAR(scene.RangeAt(10, 10), 1.0, 0.001);
  EXPECT_NEAR(scene.RangeAt(13, 10), 1.0, 0.001);  // beside them, and no surer than the rest
  EXPECT_NEAR(scene.RangeAt(1, 1), 3.0, 0.001);
}

TEST(DepthMedian, WhatIsLitUnlikeItsNeighboursKeepsItsDepth) {
  MedianScene scene(
      9, 9, [](int x, int y) { return x == 4 && y == 4 ? 220.0 : 60.0; },
      [](int x, int y) { return x == 4 && y == 4 ? 1.0 : 2.0; }, [](int, int) { return 1; });
  scene.Apply();
  EXPECT_NEAR(scene.RangeAt(4, 4), 1.0, 0.001);
}

TEST(DepthMedian, InventsNothing) {
  // Noise in everything: what comes out is a depth that a cell nearby had, empty cells are empty, confidences are kept.
  Rng rng(5);
  constexpr int kWidth = 31, kHeight = 17;
  std::vector<double> greys, ranges;
  std::vector<int> confidences;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    greys.push_back(std::round(rng.Uniform(0.0, 255.0)));
    ranges.push_back(rng.Uniform(0.0, 1.0) < 0.2 ? 0.0 : rng.Uniform(0.5, 9.0));
    confidences.push_back(static_cast<int>(rng.Uniform(0.0, 256.0)));
  }
  const auto at = [&](const auto& values) { return [&](int x, int y) { return values[y * kWidth + x]; }; };
  MedianScene scene(kWidth, kHeight, at(greys), at(ranges), at(confidences));
  const DepthMap before = scene.depth;
  scene.Apply();
  int num_changed = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int cell = y * kWidth + x;
      EXPECT_EQ(scene.depth.has_depth(cell), before.has_depth(cell));
      EXPECT_EQ(scene.depth.confidence(cell), before.confidence(cell));
      bool is_known = false;
      for (int v = std::max(0, y - 4); v <= std::min(kHeight - 1, y + 4); ++v) {
        for (int u = std::max(0, x - 4); u <= std::min(kWidth - 1, x + 4); ++u) {
          is_known |= before.codes()[v * kWidth + u] == scene.depth.codes()[cell];
        }
      }
      EXPECT_TRUE(is_known) << x << ", " << y;
      num_changed += scene.depth.codes()[cell] != before.codes()[cell];
    }
  }
  EXPECT_GT(num_changed, 100);
}

}  // namespace
}  // namespace haustra
