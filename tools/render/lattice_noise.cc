#include "tools/render/lattice_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace haustra::render {
namespace {

int Wrap(int y, int period) {
  if (period <= 0) return y;
  const int r = y % period;
  return r < 0 ? r + period : r;
}

float Fade(float t) { return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f); }

// Sixteen directions, a little beyond unit length so that the noise fills [-1, 1].
constexpr std::array<std::array<float, 2>, 16> kGradients = {{
    {1.4f, 0.0f},
    {1.29f, 0.54f},
    {0.99f, 0.99f},
    {0.54f, 1.29f},
    {0.0f, 1.4f},
    {-0.54f, 1.29f},
    {-0.99f, 0.99f},
    {-1.29f, 0.54f},
    {-1.4f, 0.0f},
    {-1.29f, -0.54f},
    {-0.99f, -0.99f},
    {-0.54f, -1.29f},
    {0.0f, -1.4f},
    {0.54f, -1.29f},
    {0.99f, -0.99f},
    {1.29f, -0.54f},
}};

}  // namespace

float GradientNoise::At(float x, float y) const {
  const float fx = std::floor(x), fy = std::floor(y);
  const int ix = static_cast<int>(fx), iy = static_cast<int>(fy);
  const float tx = x - fx, ty = y - fy;
  const auto y0 = static_cast<std::uint32_t>(Wrap(iy, period_y_)),
             y1 = static_cast<std::uint32_t>(Wrap(iy + 1, period_y_));
  const auto x0 = static_cast<std::uint32_t>(ix), x1 = static_cast<std::uint32_t>(ix + 1);
  const auto dot = [&](std::uint32_t lx, std::uint32_t ly, float dx, float dy) {
    const auto& g = kGradients[HashLattice(lx, ly, seed_) >> 28];
    return g[0] * dx + g[1] * dy;
  };
  const float a = dot(x0, y0, tx, ty), b = dot(x1, y0, tx - 1.0f, ty);
  const float c = dot(x0, y1, tx, ty - 1.0f), d = dot(x1, y1, tx - 1.0f, ty - 1.0f);
  const float u = Fade(tx), v = Fade(ty);
  const float top = a + u * (b - a), bottom = c + u * (d - c);
  return top + v * (bottom - top);
}

CellNoise::Distances CellNoise::At(float x, float y) const {
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  float first = 9.0f, second = 9.0f;
  for (int dy = -1; dy <= 1; ++dy) {
    const auto ly = static_cast<std::uint32_t>(Wrap(iy + dy, period_y_));
    for (int dx = -1; dx <= 1; ++dx) {
      const std::uint32_t h = HashLattice(static_cast<std::uint32_t>(ix + dx), ly, seed_);
      const float px = static_cast<float>(ix + dx) + static_cast<float>(h & 0xffff) * 0x1p-16f - x;
      const float py = static_cast<float>(iy + dy) + static_cast<float>(h >> 16) * 0x1p-16f - y;
      const float d2 = px * px + py * py;
      second = std::min(second, std::max(first, d2));
      first = std::min(first, d2);
    }
  }
  return {std::sqrt(first), std::sqrt(second)};
}

Wander::Wander(Rng& rng, double min_frequency, double max_frequency) {
  constexpr int kNumWaves = 5;
  double sum = 0.0;
  for (int i = 0; i < kNumWaves; ++i) {
    const double f = min_frequency * std::pow(max_frequency / min_frequency, (i + rng.Uniform()) / kNumWaves);
    // Amplitude falls with frequency: hands drift far slowly and tremble little.
    const double amplitude = rng.Uniform(0.6, 1.0) * min_frequency / f;
    waves_.push_back({f, rng.Uniform(0.0, 2.0 * std::numbers::pi), amplitude});
    sum += amplitude;
  }
  for (Wave& wave : waves_) wave.amplitude /= sum;
}

double Wander::At(double x) const {
  double value = 0.0;
  for (const Wave& w : waves_) value += w.amplitude * std::sin(2.0 * std::numbers::pi * w.frequency * x + w.phase);
  return value;
}

}  // namespace haustra::render
