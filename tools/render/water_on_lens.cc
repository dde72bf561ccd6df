#include "tools/render/lens_layers.h"

#include <algorithm>
#include <cmath>

#include "tools/render/lattice_noise.h"
#include "tools/render/soft_focus.h"

namespace haustra::render {

// A running film: each column of water bends and blurs what is behind it.
void DrawWater(const LensMoment& moment, LinearImage* image) {
  const float alpha = moment.alpha, time_s = moment.since_s, level = moment.level;
  const GradientNoise bend_x(moment.seed, 0), bend_y(moment.seed + 1, 0), haze(moment.seed + 2, 0);
  const LinearImage sharp = *image;
  const LinearImage blurred = Blurred(*image);
  const auto height = static_cast<float>(image->height);
  const float strength = alpha * 0.07f * height;
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const float u = static_cast<float>(x) / height, v = static_cast<float>(y) / height - 0.55f * time_s;
      const float dx = bend_x.At(4.2f * u, 3.0f * v + 0.7f * time_s) + 0.5f * bend_x.At(11.0f * u, 8.0f * v);
      const float dy = bend_y.At(4.2f * u, 3.0f * v - 0.5f * time_s) + 0.5f * bend_y.At(11.0f * u, 8.0f * v);
      const float blur = std::clamp(alpha * (0.95f + 0.8f * haze.At(3.1f * u, 2.3f * v)), 0.0f, 1.0f);
      const float sx = static_cast<float>(x) + strength * dx, sy = static_cast<float>(y) + strength * dy;
      float clear[3], soft[3];
      SampleBilinear(sharp, sx, sy, clear);
      SampleBlurred(blurred, sx, sy, soft);
      float* out = image->pixel(x, y);
      const float glint = alpha * level * std::max(0.0f, dx + dy - 0.75f) * 1.6f;
      for (int c = 0; c < 3; ++c) out[c] = Mix(clear[c], soft[c], blur) + glint;
    }
  }
}

}  // namespace haustra::render
