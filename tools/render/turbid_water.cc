#include "tools/render/lens_layers.h"

#include <algorithm>
#include <cmath>

#include "tools/render/lattice_noise.h"
#include "tools/render/soft_focus.h"

namespace haustra::render {

// Turbid liquid with flecks.
void DrawTurbidWater(const LensMoment& moment, LinearImage* image) {
  const float alpha = moment.alpha, time_s = moment.since_s, level = moment.level;
  LensMoment film = moment;
  film.alpha *= 0.5f;
  DrawWater(film, image);
  const GradientNoise clouds(moment.seed + 5, 0);
  const auto height = static_cast<float>(image->height);
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const float u = static_cast<float>(x) / height - 0.5f * time_s,
                  v = static_cast<float>(y) / height + 0.4f * time_s;
      float thick = clouds.At(2.6f * u, 2.6f * v) + 0.5f * clouds.At(6.1f * u + 3.0f, 6.1f * v + 0.8f * time_s) +
                    0.25f * clouds.At(14.0f * u, 14.0f * v);
      const float opacity = alpha * std::clamp(0.92f + 0.55f * thick, 0.30f, 0.985f);
      const float light = level * (2.3f + 1.2f * thick);
      const float liquid[3] = {1.45f * light, 1.05f * light, 0.48f * light};
      float* out = image->pixel(x, y);
      for (int c = 0; c < 3; ++c) out[c] = Mix(out[c], liquid[c], opacity);
    }
  }
  for (const Drop& b : moment.drops) {
    const float age = time_s - b.birth_s;
    if (age < 0.0f || age > b.life_s) continue;
    const float cx = (b.x + 2.2f * b.drift_x * age) * height, cy = (b.y + 2.2f * b.drift_y * age) * height;
    const float radius = b.radius * height;
    const int x0 = std::max(0, static_cast<int>(cx - radius)),
              x1 = std::min(image->width - 1, static_cast<int>(cx + radius));
    const int y0 = std::max(0, static_cast<int>(cy - radius)),
              y1 = std::min(image->height - 1, static_cast<int>(cy + radius));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const float qx = (static_cast<float>(x) - cx) / radius, qy = (static_cast<float>(y) - cy) / radius;
        const float uneven = 0.35f * clouds.At(3.0f * qx + 10.0f * b.x, 3.0f * qy + 10.0f * b.y);
        const float cover = alpha * std::clamp((1.0f - qx * qx - qy * qy + uneven) * 2.0f, 0.0f, 0.9f);
        const float fleck[3] = {1.1f * level, 0.66f * level, 0.20f * level};
        float* out = image->pixel(x, y);
        for (int c = 0; c < 3; ++c) out[c] = Mix(out[c], fleck[c], cover);
      }
    }
  }
}

}  // namespace haustra::render
