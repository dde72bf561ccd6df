#include "tools/render/lens_layers.h"

#include <algorithm>
#include <cmath>

#include "tools/render/lattice_noise.h"
#include "tools/render/soft_focus.h"

namespace haustra::render {

// Tissue on the glass: lit from within, no detail but slow clouds of colour.
void DrawTissue(const LensMoment& moment, LinearImage* image) {
  const float alpha = moment.alpha, time_s = moment.since_s, level = moment.level;
  const GradientNoise clouds(moment.seed, 0), hues(moment.seed + 1, 0);
  const LinearImage blurred = Blurred(*image);
  const float scale = 1.0f / static_cast<float>(image->height);
  const float direction = 6.2831853f * UnitFromHash(moment.seed), push_x = std::cos(direction),
              push_y = std::sin(direction);
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const float u = static_cast<float>(x) * scale, v = static_cast<float>(y) * scale;
      const float cloud = clouds.At(2.1f * u + 0.9f * time_s, 2.1f * v - 0.6f * time_s) +
                          0.4f * clouds.At(5.3f * u + 7.7f + 0.9f * time_s, 5.3f * v);
      const float hue = hues.At(1.7f * u - 0.5f * time_s, 1.7f * v + 0.4f * time_s);
      const float r2 = (u - 0.66f) * (u - 0.66f) + (v - 0.5f) * (v - 0.5f);
      // In the far corners of a wide picture the falling edge would be below zero.
      const float glow = level * 5.5f * (1.0f + 0.4f * cloud) * std::max(1.15f - 0.9f * r2, 0.2f);
      const float tissue[3] = {2.0f * glow, glow * (0.52f + 0.20f * hue), glow * (0.31f + 0.14f * hue)};
      float soft[3];
      SampleBlurred(blurred, static_cast<float>(x), static_cast<float>(y), soft);
      float* out = image->pixel(x, y);
      // The wall slides over the glass from one side; next to where it lies everything is out of focus.
      const float side = 0.5f + 0.45f * (push_x * (u - 0.66f) + push_y * (v - 0.5f)) + 0.15f * cloud;
      const float cover = std::clamp(2.0f * (alpha * 1.75f - side) + 0.5f, 0.0f, 1.0f);
      const float defocus = std::min(1.0f, 2.5f * alpha);
      for (int c = 0; c < 3; ++c) out[c] = Mix(Mix(out[c], soft[c], defocus), tissue[c], cover);
    }
  }
}

}  // namespace haustra::render
