#include "tools/render/lens_effects.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/rng.h"
#include "tools/render/lattice_noise.h"

namespace haustra::render {
namespace {

constexpr int kBlock = 8;  // pixels a side of the blurred copy's cells

// Brightness of the middle of the picture's scale: the mean of the square roots, squared, which highlights hardly move.
float TypicalLevel(const LinearImage& image) {
  double sum = 0.0;
  int count = 0;
  for (int y = kBlock / 2; y < image.height; y += kBlock) {
    for (int x = kBlock / 2; x < image.width; x += kBlock) {
      const float green = image.pixel(x, y)[1];
      if (green <= 0.0f) continue;
      sum += std::sqrt(green);
      ++count;
    }
  }
  const double mean = count > 0 ? sum / count : 0.1;
  return static_cast<float>(mean * mean);
}

// Averages of blocks, for everything that is out of focus.
LinearImage Blurred(const LinearImage& image) {
  LinearImage out((image.width + kBlock - 1) / kBlock, (image.height + kBlock - 1) / kBlock);
  for (int by = 0; by < out.height; ++by) {
    for (int bx = 0; bx < out.width; ++bx) {
      float sum[3] = {0.0f, 0.0f, 0.0f};
      int count = 0;
      for (int y = by * kBlock; y < std::min((by + 1) * kBlock, image.height); ++y) {
        for (int x = bx * kBlock; x < std::min((bx + 1) * kBlock, image.width); ++x, ++count) {
          for (int c = 0; c < 3; ++c) sum[c] += std::min(image.pixel(x, y)[c], 8.0f);
        }
      }
      for (int c = 0; c < 3; ++c) out.pixel(bx, by)[c] = sum[c] / static_cast<float>(count);
    }
  }
  return out;
}

void SampleBilinear(const LinearImage& image, float x, float y, float rgb[3]) {
  x = std::clamp(x, 0.0f, static_cast<float>(image.width) - 1.001f);
  y = std::clamp(y, 0.0f, static_cast<float>(image.height) - 1.001f);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float tx = x - static_cast<float>(ix), ty = y - static_cast<float>(iy);
  const float* p00 = image.pixel(ix, iy);
  const float* p01 = image.pixel(ix, std::min(iy + 1, image.height - 1));
  const int right = ix + 1 < image.width ? 3 : 0;
  for (int c = 0; c < 3; ++c) {
    const float top = p00[c] + tx * (p00[right + c] - p00[c]);
    const float bottom = p01[c] + tx * (p01[right + c] - p01[c]);
    rgb[c] = top + ty * (bottom - top);
  }
}
void SampleBlurred(const LinearImage& blurred, float x, float y, float rgb[3]) {
  SampleBilinear(blurred, (x + 0.5f) / kBlock - 0.5f, (y + 0.5f) / kBlock - 0.5f, rgb);
}

float Mix(float a, float b, float t) { return a + t * (b - a); }

}  // namespace

LensEffects::LensEffects(const std::vector<Event>& events, const WindowMask& window, std::uint64_t seed) {
  Rng rng(seed, 0x1e25);
  const auto draw = [&](double low, double high) { return static_cast<float>(rng.Uniform(low, high)); };
  for (const Event& event : events) {
    Active active{event, rng.Next(), {}};
    const bool is_foam = event.kind == EventKind::kBubbles;
    if (is_foam || event.kind == EventKind::kDebris) {
      const int count = static_cast<int>((is_foam ? 420 : 90) * std::max(event.duration_s, 0.5));
      for (int i = 0; i < count; ++i) {
        const double size = std::pow(rng.Uniform(), 2.2);
        Bubble b{};
        b.x = draw(-0.05, 1.4);
        b.y = draw(-0.05, 1.05);
        b.radius = static_cast<float>(is_foam ? 0.012 + 0.085 * size : 0.004 + 0.03 * size);
        b.drift_x = draw(-0.35, 0.35);
        b.drift_y = draw(-0.55, 0.25);
        b.life_s = draw(0.25, 1.1);
        b.birth_s = draw(-0.5 * b.life_s, event.duration_s);
        active.bubbles.push_back(b);
      }
    }
    active_.push_back(std::move(active));
  }
  if (events.empty()) return;
  // Each pixel of the surround takes the last one of the window on its way to the middle.
  const int width = window.mask().width, height = window.mask().height;
  const float cx = 0.5f * static_cast<float>(width - 1), cy = 0.5f * static_cast<float>(height - 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (window.coverage(x, y) > 0.0f) continue;
      for (float share = 0.99f; share > 0.0f; share -= 0.005f) {
        const int sx = static_cast<int>(cx + share * (static_cast<float>(x) - cx) + 0.5f);
        const int sy = static_cast<int>(cy + share * (static_cast<float>(y) - cy) + 0.5f);
        if (window.coverage(sx, sy) <= 0.0f) continue;
        surround_.push_back({y * width + x, sy * width + sx});
        break;
      }
    }
  }
}

void LensEffects::FillSurround(LinearImage* image) const {
  for (const Copy& copy : surround_) {
    for (int c = 0; c < 3; ++c) image->rgb[std::size_t(3) * copy.to + c] = image->rgb[std::size_t(3) * copy.from + c];
  }
}

bool LensEffects::IsActive(double time_s) const {
  return std::any_of(active_.begin(), active_.end(), [&](const Active& a) {
    return a.event.kind != EventKind::kBlur && a.event.kind != EventKind::kJump && a.event.Envelope(time_s) > 0.0;
  });
}

void LensEffects::Apply(double time_s, LinearImage* image) const {
  for (const Active& active : active_) {
    const auto alpha = static_cast<float>(active.event.Envelope(time_s));
    if (alpha <= 0.0f) continue;
    FillSurround(image);
    const auto since = static_cast<float>(time_s - active.event.start_s);
    const float level = TypicalLevel(*image);
    switch (active.event.kind) {
      case EventKind::kRedout: Redden(active, alpha, since, level, image); break;
      case EventKind::kWater: Flood(active, alpha, since, level, image); break;
      case EventKind::kBubbles: Foam(active, alpha, since, level, image); break;
      case EventKind::kDebris: Cloud(active, alpha, since, level, image); break;
      case EventKind::kBlur:
      case EventKind::kJump: break;  // in the path and the shutter
    }
  }
}

// Tissue on the glass: lit from within, no detail but slow clouds of colour.
void LensEffects::Redden(const Active& active, float alpha, float time_s, float level, LinearImage* image) {
  const GradientNoise clouds(active.seed, 0), hues(active.seed + 1, 0);
  const LinearImage blurred = Blurred(*image);
  const float scale = 1.0f / static_cast<float>(image->height);
  const float direction = 6.2831853f * UnitFromHash(active.seed), push_x = std::cos(direction),
              push_y = std::sin(direction);
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const float u = static_cast<float>(x) * scale, v = static_cast<float>(y) * scale;
      const float cloud = clouds.At(2.1f * u + 0.9f * time_s, 2.1f * v - 0.6f * time_s) +
                          0.4f * clouds.At(5.3f * u + 7.7f + 0.9f * time_s, 5.3f * v);
      const float hue = hues.At(1.7f * u - 0.5f * time_s, 1.7f * v + 0.4f * time_s);
      const float r2 = (u - 0.66f) * (u - 0.66f) + (v - 0.5f) * (v - 0.5f);
      const float glow = level * 5.5f * (1.0f + 0.4f * cloud) * (1.15f - 0.9f * r2);
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

// A running film: each column of water bends and blurs what is behind it.
void LensEffects::Flood(const Active& active, float alpha, float time_s, float level, LinearImage* image) {
  const GradientNoise bend_x(active.seed, 0), bend_y(active.seed + 1, 0), haze(active.seed + 2, 0);
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

// Drops and foam: each is a small lens with a dark rim and mirrored lamps; between them the picture is blurred.
void LensEffects::Foam(const Active& active, float alpha, float time_s, float level, LinearImage* image) {
  Flood(active, 0.55f * alpha, time_s, level, image);
  const LinearImage behind = *image;
  const auto height = static_cast<float>(image->height);
  for (const Bubble& b : active.bubbles) {
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

// Turbid liquid with flecks.
void LensEffects::Cloud(const Active& active, float alpha, float time_s, float level, LinearImage* image) {
  Flood(active, 0.5f * alpha, time_s, level, image);
  const GradientNoise clouds(active.seed + 5, 0);
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
  for (const Bubble& b : active.bubbles) {
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
