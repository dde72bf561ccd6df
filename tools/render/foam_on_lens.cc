#include "tools/render/lens_layers.h"

#include <algorithm>
#include <cmath>

#include "tools/render/lattice_noise.h"
#include "tools/render/soft_focus.h"

namespace haustra::render {

// Drops and foam: each is a small lens with a dark rim and mirrored lamps; between them the picture is blurred.
void DrawFoam(const LensMoment& moment, LinearImage* image) {
  const float alpha = moment.alpha, time_s = moment.since_s, level = moment.level;
  LensMoment film = moment;
  film.alpha *= 0.55f;
  DrawWater(film, image);
  const LinearImage behind = *image;
  const auto height = static_cast<float>(image->height);
  for (const Drop& b : moment.drops) {
    const float age = time_s - b.birth_s;
    if (age < 0.0f || age > b.life_s) continue;
    const float grown = std::min(1.0f, age / 0.08f);
    const float radius = b.radius * height * grown, cx = (b.x + b.drift_x * age) * height,
                cy = (b.y + b.drift_y * age) * height;
    const int x0 = std::max(0, static_cast<int>(cx - radius)),
              x1 = std::min(image->width - 1, static_cast<int>(cx + radius));
    const int y0 = std::max(0, static_cast<int>(cy - radius)),
              y1 = std::min(image->height - 1, static_cast<int>(cy + radius));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const float qx = (static_cast<float>(x) - cx) / radius, qy = (static_cast<float>(y) - cy) / radius;
        const float q2 = qx * qx + qy * qy;
        if (q2 >= 1.0f) continue;
        // A drop shows the scene upside down, small.
        float seen[3];
        SampleBilinear(behind, cx - 1.9f * radius * qx, cy - 1.9f * radius * qy, seen);
        const float rim = q2 * q2 * q2;
        const auto lamp = [&](float lx, float ly, float sharpness) {
          return std::exp(-sharpness * ((qx - lx) * (qx - lx) + (qy - ly) * (qy - ly)));
        };
        const float shine =
            level * (9.0f * lamp(-0.38f, -0.42f, 60.0f) + 3.0f * lamp(0.42f, 0.45f, 30.0f) + 0.9f * rim);
        const float cover = alpha * std::min(1.0f, (1.0f - q2) * 6.0f);
        float* out = image->pixel(x, y);
        for (int c = 0; c < 3; ++c) {
          const float drop = 0.78f * seen[c] * (1.0f - 0.55f * rim) + 0.12f * level + shine;
          out[c] = Mix(out[c], drop, cover);
        }
      }
    }
  }
}

}  // namespace haustra::render
