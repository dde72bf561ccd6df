#include "tools/render/sensor.h"

#include <algorithm>
#include <cmath>

#include "tools/render/exposure.h"
#include "tools/render/lattice_noise.h"

namespace haustra::render {
namespace {

constexpr float kFullWell = 9.0f;  // exposed light beyond which a pixel holds no more
constexpr float kToneStepsPerRoot = 1400.0f;
constexpr float kSideTap = 0.14f;      // of the 3-tap blur: standard deviation 0.53 px
constexpr float kShotNoise = 3.8e-4f;  // variance per exposed light
constexpr float kReadNoise = 3.5e-6f;  // variance

// Four bytes make a good enough bell curve: standard deviation 1.
float Bell(std::uint32_t h) {
  const std::uint32_t sum = (h & 0xff) + ((h >> 8) & 0xff) + ((h >> 16) & 0xff) + (h >> 24);
  return (static_cast<float>(sum) - 510.0f) * (1.0f / 147.8f);
}

}  // namespace

Sensor::Sensor(const WindowMask& window, int width_px, int height_px, float noise, std::uint64_t seed)
    : window_(window), noise_(noise), seed_(static_cast<std::uint32_t>(seed ^ (seed >> 32))) {
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const float u = (static_cast<float>(x) - 0.5f * static_cast<float>(width_px)) / static_cast<float>(height_px);
      const float v = (static_cast<float>(y) - 0.5f * static_cast<float>(height_px)) / static_cast<float>(height_px);
      vignette_.push_back(1.0f / (1.0f + 0.45f * (u * u + v * v)));
    }
  }
  const int steps = static_cast<int>(std::sqrt(kFullWell) * kToneStepsPerRoot) + 2;
  for (int i = 0; i < steps; ++i) {
    const float root = static_cast<float>(i) / kToneStepsPerRoot;
    tone_.push_back(static_cast<std::uint8_t>(std::lround(255.0f * ToneCurve(root * root))));
  }
}

void Sensor::Develop(float gain, int frame, LinearImage* linear, Image* picture) const {
  const int width = linear->width, height = linear->height;
  picture->Resize(width, height, PixelFormat::kBgr8);
  // Exposure and full well first: glare of a highlight does not spread farther than its pixel's share.
  for (float& value : linear->rgb) value = std::clamp(value * gain, 0.0f, kFullWell);
  const std::size_t pitch = std::size_t(3) * width;
  std::vector<float> rows[3];  // blurred along x: rows y - 1, y, y + 1
  for (auto& row : rows) row.resize(pitch);
  const auto blur_row = [&](int y, std::vector<float>* out) {
    const float* in = linear->pixel(0, std::clamp(y, 0, height - 1));
    for (std::size_t i = 0; i < pitch; ++i) {
      const float left = i >= 3 ? in[i - 3] : in[i], right = i + 3 < pitch ? in[i + 3] : in[i];
      (*out)[i] = (1.0f - 2.0f * kSideTap) * in[i] + kSideTap * (left + right);
    }
  };
  blur_row(0, &rows[0]);
  blur_row(0, &rows[1]);
  for (int y = 0; y < height; ++y) {
    std::vector<float>&above = rows[y % 3], &here = rows[(y + 1) % 3], &below = rows[(y + 2) % 3];
    blur_row(y + 1, &below);
    std::uint8_t* out = picture->row(y);
    for (int x = 0; x < width; ++x, out += 3) {
      const float cover = window_.coverage(x, y);
      if (cover <= 0.0f) {
        out[0] = out[1] = out[2] = 0;
        continue;
      }
      const float vignette = vignette_[std::size_t(y) * width + x];
      const std::uint32_t h =
          HashLattice(static_cast<std::uint32_t>(y * width + x), static_cast<std::uint32_t>(frame), seed_);
      const float common = 0.75f * Bell(h);
      for (int c = 0; c < 3; ++c) {
        const std::size_t i = std::size_t(3) * x + c;
        float light = (1.0f - 2.0f * kSideTap) * here[i] + kSideTap * (above[i] + below[i]);
        light *= vignette;
        const float own = Bell((h + static_cast<std::uint32_t>(c + 1) * 0x9e3779b9u) * 0x2c1b3c6du);
        light += noise_ * std::sqrt(kShotNoise * light + kReadNoise) * (common + 0.6f * own);
        const float root = std::sqrt(std::clamp(light, 0.0f, kFullWell));
        const std::uint8_t value = tone_[static_cast<std::size_t>(root * kToneStepsPerRoot)];
        out[2 - c] = cover >= 1.0f ? value : static_cast<std::uint8_t>(std::lround(cover * static_cast<float>(value)));
      }
    }
  }
}

}  // namespace haustra::render
