// Light that reaches the sensor, in linear units of the scene (no exposure yet): three floats a pixel, red first.
#pragma once

#include <vector>

namespace haustra::render {

struct LinearImage {
  int width = 0;
  int height = 0;
  std::vector<float> rgb;

  LinearImage() = default;
  LinearImage(int width_px, int height_px)
      : width(width_px), height(height_px), rgb(std::size_t(3) * width_px * height_px, 0.0f) {}
  float* pixel(int x, int y) { return &rgb[3 * (std::size_t(y) * width + x)]; }
  const float* pixel(int x, int y) const { return &rgb[3 * (std::size_t(y) * width + x)]; }
};

}  // namespace haustra::render
