#include "tools/render/liquid_look.h"

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

// Per mm: absorbed and scattered away. Bile takes the blue.
constexpr std::array<float, 3> kLiquidPerMm = {0.055f, 0.075f, 0.15f};
// What deep liquid scatters back.
constexpr std::array<float, 3> kLiquidRgb = {0.36f, 0.195f, 0.05f};
constexpr float kScatterShare = 0.62f, kWrap = 0.1f;
constexpr std::array<float, 3> kFoamRgb = {0.62f, 0.54f, 0.36f};
// At flat angles the walls above are mirrored.
constexpr std::array<float, 3> kMirroredRgb = {0.36f, 0.13f, 0.08f};
constexpr float kLiquidReflectance = 0.021f;  // at normal incidence
constexpr float kMeniscusMm = 1.1f, kSteepestShore = 2.5f;
constexpr float kCloudShare = 0.22f;

}  // namespace

LiquidLook LookInto(const LiquidSurface& surface, float path_mm, float cosine, float level_cosine) {
  const float flat = 1.0f - std::clamp(cosine, 0.0f, 1.0f), flat2 = flat * flat;
  const float mirrored = kLiquidReflectance + (1.0f - kLiquidReflectance) * flat2 * flat2 * flat;
  // What takes the cosine out again that light on something solid goes by.
  const float evenly = kScatterShare * (1.0f + kWrap) / (std::max(level_cosine, 0.0f) + kWrap);
  const float murk = 1.0f + kCloudShare * surface.cloud;
  LiquidLook look{};
  for (int c = 0; c < 3; ++c) {
    const float through = std::exp(-2.0f * kLiquidPerMm[c] * murk * path_mm);
    const float seen = (1.0f - mirrored) * (1.0f - mirrored) * (1.0f - surface.foam);
    look.through[c] = seen * through;
    look.sample.rgb[c] = seen * (1.0f - through) * evenly * murk * kLiquidRgb[c] + mirrored * kMirroredRgb[c] +
                         surface.foam * kFoamRgb[c];
  }
  look.sample.wetness = 1.0f;
  look.sample.slope_u = surface.slope_x;
  look.sample.slope_v = surface.slope_y;
  return look;
}

float MeniscusSlope(float wall_slope, float to_shore_mm, float footprint_mm) {
  const float wide = footprint_mm / kMeniscusMm;
  const float slope = std::clamp(wall_slope, 0.0f, kSteepestShore) / (1.0f + wide * wide);
  return slope * std::exp(-std::max(to_shore_mm, 0.0f) / kMeniscusMm);
}

}  // namespace haustra::render
