#include "tools/render/exposure.h"

#include <gtest/gtest.h>

namespace haustra::render {
namespace {

// A wall that gets darker from left to right, `level` times as bright as usual.
LinearImage Scene(float level) {
  LinearImage image(160, 120);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) image.pixel(x, y)[c] = level * 0.5f / (1.0f + 0.1f * static_cast<float>(x));
    }
  }
  return image;
}

float Brightness(const LinearImage& image, const WindowMask& window, float gain) {
  double sum = 0.0;
  int count = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (window.coverage(x, y) < 1.0f) continue;
      sum += ToneCurve(gain * image.pixel(x, y)[1]);
      ++count;
    }
  }
  return static_cast<float>(sum / count);
}

TEST(ToneCurve, RisesFromBlackToWhite) {
  EXPECT_EQ(ToneCurve(0.0f), 0.0f);
  float previous = 0.0f;
  for (float x = 0.01f; x < 9.0f; x += 0.05f) {
    EXPECT_GT(ToneCurve(x), previous);
    previous = ToneCurve(x);
  }
  EXPECT_GT(previous, 0.99f);
  EXPECT_LE(previous, 1.0f);
}

TEST(AutoExposure, StartsAtItsTarget) {
  const WindowMask window(160, 120);
  for (const float level : {0.05f, 1.0f, 20.0f}) {
    const LinearImage image = Scene(level);
    AutoExposure exposure;
    exposure.Start(Meter(image, window));
    const float brightness = Brightness(image, window, exposure.gain());
    EXPECT_GT(brightness, 0.42f) << level;
    EXPECT_LT(brightness, 0.54f) << level;
  }
}

TEST(AutoExposure, FollowsAStepWithALag) {
  const WindowMask window(160, 120);
  const LinearImage dark = Scene(1.0f), bright = Scene(8.0f);
  AutoExposure exposure;
  exposure.Start(Meter(dark, window));
  const Metering metering = Meter(bright, window);
  const float start = exposure.gain();
  exposure.Update(metering, 0.04);
  const float after_one = exposure.gain();
  for (int i = 0; i < 40; ++i) exposure.Update(metering, 0.04);
  const float at_end = exposure.gain();
  EXPECT_LT(after_one, start);
  EXPECT_GT(after_one, 2.0f * at_end);  // far from done after one frame
  const float brightness = Brightness(bright, window, at_end);
  EXPECT_GT(brightness, 0.42f);
  EXPECT_LT(brightness, 0.54f);
}

}  // namespace
}  // namespace haustra::render
