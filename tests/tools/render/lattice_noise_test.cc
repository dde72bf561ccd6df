#include "tools/render/lattice_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

TEST(GradientNoise, RepeatsAroundTheGirth) {
  const GradientNoise noise(7, 12);
  for (int i = 0; i < 50; ++i) {
    const float x = 0.37f * static_cast<float>(i), y = 0.23f * static_cast<float>(i);
    EXPECT_NEAR(noise.At(x, y), noise.At(x, y + 12.0f), 1e-4f);
  }
}

TEST(GradientNoise, IsContinuousAcrossCells) {
  const GradientNoise noise(3, 0);
  for (int i = -5; i < 5; ++i) {
    const auto edge = static_cast<float>(i);
    EXPECT_NEAR(noise.At(edge - 1e-4f, 0.6f), noise.At(edge + 1e-4f, 0.6f), 2e-3f);
    EXPECT_NEAR(noise.At(0.6f, edge - 1e-4f), noise.At(0.6f, edge + 1e-4f), 2e-3f);
  }
}

TEST(GradientNoise, SeedsDiffer) {
  const GradientNoise a(1, 0), b(2, 0);
  double difference = 0.0;
  for (int i = 0; i < 100; ++i) {
    const float x = 0.31f * static_cast<float>(i);
    difference += std::abs(a.At(x, 0.5f) - b.At(x, 0.5f));
  }
  EXPECT_GT(difference, 5.0);
}

TEST(CellNoise, NearestIsNotFartherThanSecond) {
  const CellNoise noise(5, 20);
  for (int i = 0; i < 200; ++i) {
    const auto d = noise.At(0.17f * static_cast<float>(i), 0.29f * static_cast<float>(i));
    EXPECT_LE(d.nearest, d.second);
    EXPECT_LE(d.nearest, 1.5f);  // a neighbouring cell always has a point this near
  }
}

TEST(Wander, StaysInsideUnity) {
  Rng rng(9);
  const Wander wander(rng, 0.1, 1.0);
  double largest = 0.0;
  for (int i = 0; i < 5000; ++i) largest = std::max(largest, std::abs(wander.At(0.02 * i)));
  EXPECT_LE(largest, 1.0);
  EXPECT_GT(largest, 0.4);
}

}  // namespace
}  // namespace haustra::render
