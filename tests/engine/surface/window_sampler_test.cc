// Windows in pictures that are a formula: what their sums are, a formula says, too.
#include "engine/surface/window_sampler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/geometry/rng.h"
#include "tests/engine/surface/guarded_picture.h"

namespace haustra {
namespace {

constexpr int kWidth = 60, kHeight = 50;

constexpr int kBase = 10, kAcross = 2, kDown = 1;

// Rises along its rows and columns.
Picture Ramp() {
  Picture picture{{}, kWidth, kHeight};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      picture.pixels.push_back(static_cast<std::uint8_t>(kBase + kAcross * x + kDown * y));
    }
  }
  return picture;
}

class WindowSamplerTest : public testing::TestWithParam<int> {
 protected:
  // Alike for all samples, none for the filler.
  std::vector<float> Even() const {
    std::vector<float> weights(sampler_.padded_size(), 0.0f);
    std::fill_n(weights.begin(), num_samples_, 1.0f / static_cast<float>(num_samples_));
    return weights;
  }

  const int radius_ = GetParam(), side_ = 2 * radius_ + 1, num_samples_ = side_ * side_;
  const WindowSampler sampler_{radius_};
};

// The mean of a ramp is its value in the centre, and its deviation along the rows of the window is that of the steps.
TEST_P(WindowSamplerTest, SumsOfARampAreThoseOfItsFormula) {
  const Picture ramp = Ramp();
  const std::vector<float> weights = Even();
  std::vector<float> patterns(weights.size(), 0.0f);
  double mean_square_step = 0.0;
  for (int k = 0; k < num_samples_; ++k) {
    const int u = k % side_ - radius_;
    patterns[static_cast<std::size_t>(k)] = static_cast<float>(u) * weights[0];
    mean_square_step += static_cast<double>(u * u) / num_samples_;
  }
  Rng rng(7);
  for (int trial = 0; trial < 50; ++trial) {
    WindowFrame frame;
    frame.x = static_cast<float>(rng.Uniform(24.0, 34.0));
    frame.y = static_cast<float>(rng.Uniform(20.0, 28.0));
    for (float* step : {&frame.along_row_x, &frame.along_row_y, &frame.along_column_x, &frame.along_column_y}) {
      *step = static_cast<float>(rng.Uniform(-2.0, 2.0));
    }
    const WindowSums sums = sampler_.Sum(ramp.view(), frame, weights.data(), patterns.data());
    const double centre = kBase + kAcross * frame.x + kDown * frame.y;
    const double along_row = kAcross * frame.along_row_x + kDown * frame.along_row_y;
    const double along_column = kAcross * frame.along_column_x + kDown * frame.along_column_y;
    EXPECT_NEAR(sums.values, centre, 1e-3);
    EXPECT_NEAR(sums.products, along_row * mean_square_step, 1e-3);
    const double variance = (along_row * along_row + along_column * along_column) * mean_square_step;
    EXPECT_NEAR(sums.squares, centre * centre + variance, 0.05);
  }
}

// A corner that rounding has put upon the last row and column has their value, and nothing beyond them is read.
TEST_P(WindowSamplerTest, ACornerUponTheLastRowIsThere) {
  const GuardedPicture ramp(Ramp());
  WindowFrame frame;
  frame.along_row_x = frame.along_column_y = 1.0f;
  frame.x = static_cast<float>(kWidth - 1 - radius_);
  frame.y = static_cast<float>(kHeight - 1 - radius_);
  std::vector<float> last(sampler_.padded_size(), 0.0f);
  last[static_cast<std::size_t>(num_samples_) - 1] = 1.0f;
  EXPECT_NEAR(sampler_.Sum(ramp.view(), frame, last.data(), last.data()).values,
              kBase + kAcross * (kWidth - 1) + kDown * (kHeight - 1), 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Radii, WindowSamplerTest, testing::Values(1, 2, 3, 4, 5));

}  // namespace
}  // namespace haustra
