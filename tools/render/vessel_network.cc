#include "tools/render/vessel_network.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace haustra::render {
namespace {

constexpr double kVesselStepMm = 0.3;
constexpr double kHairWidthMm = 0.07;
constexpr int kMaxDepth = 5;

struct Shoot {
  double u, v, heading_rad, width_mm, length_mm, opacity;
  int depth;
};

// A capsule from (u0, v0) to (u1, v1) with a soft rim of about one texel.
void DrawStroke(double u0, double v0, double u1, double v1, double width_mm, double opacity, SurfaceMap* map) {
  const double texel = map->texel_mm;
  const double half = 0.5 * width_mm, rim = std::max(0.45 * width_mm, texel);
  const double reach = half + rim;
  const int first_row = std::max(0, static_cast<int>(std::floor((std::min(u0, u1) - reach) / texel)));
  const int last_row = std::min(map->rows - 1, static_cast<int>(std::ceil((std::max(u0, u1) + reach) / texel)));
  const int first_column = static_cast<int>(std::floor((std::min(v0, v1) - reach) / texel));
  const int last_column = static_cast<int>(std::ceil((std::max(v0, v1) + reach) / texel));
  const double du = u1 - u0, dv = v1 - v0, norm2 = std::max(du * du + dv * dv, 1e-12);
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      const double pu = row * texel - u0, pv = column * texel - v0;
      const double along = std::clamp((pu * du + pv * dv) / norm2, 0.0, 1.0);
      const double distance = std::hypot(pu - along * du, pv - along * dv);
      const double inside = std::clamp((reach - distance) / rim, 0.0, 1.0);
      if (inside <= 0.0) continue;
      const auto value = static_cast<std::uint8_t>(255.0 * opacity * inside * inside * (3.0 - 2.0 * inside));
      const int wrapped = ((column % map->columns) + map->columns) % map->columns;
      std::uint8_t& texel_value = map->values[std::size_t(row) * map->columns + wrapped];
      texel_value = std::max(texel_value, value);
    }
  }
}

// Draws one vessel and returns the shoots that leave it.
void Grow(const Shoot& shoot, Rng& rng, SurfaceMap* map, std::vector<Shoot>* shoots) {
  double u = shoot.u, v = shoot.v, heading = shoot.heading_rad, bend = 0.0;
  const int num_steps = static_cast<int>(shoot.length_mm / kVesselStepMm);
  double until_branch = rng.Uniform(1.5, 5.0) * (0.6 + shoot.width_mm);
  const double wiggle = 0.055 + 0.010 * shoot.depth;
  for (int i = 0; i < num_steps; ++i) {
    const double progress = static_cast<double>(i) / num_steps;
    const double width = shoot.width_mm * (1.0 - 0.6 * progress);
    if (width < kHairWidthMm) return;
    bend = 0.88 * bend + wiggle * (rng.Uniform() + rng.Uniform() - 1.0);
    // Drawn back to the direction in which it began: without this a vessel curls up.
    heading += bend - 0.03 * (heading - shoot.heading_rad);
    const double next_u = u + kVesselStepMm * std::cos(heading), next_v = v + kVesselStepMm * std::sin(heading);
    // The end of a vessel dives below the surface.
    const double fade = std::min(1.0, 3.0 * (1.0 - progress));
    DrawStroke(u, v, next_u, next_v, width, shoot.opacity * fade, map);
    u = next_u;
    v = next_v;
    until_branch -= kVesselStepMm;
    if (until_branch <= 0.0 && shoot.depth < kMaxDepth) {
      until_branch = rng.Uniform(2.0, 8.0) * (0.8 + width);
      const double side = rng.Uniform() < 0.5 ? -1.0 : 1.0;
      shoots->push_back({u, v, heading + side * rng.Uniform(0.35, 1.15), width * rng.Uniform(0.45, 0.78),
                         shoot.length_mm * rng.Uniform(0.22, 0.6), shoot.opacity * rng.Uniform(0.8, 1.0),
                         shoot.depth + 1});
    }
  }
}

}  // namespace

void DrawVessels(const VesselStyle& style, Rng& rng, SurfaceMap* map) {
  const double length_mm = map->rows * map->texel_mm, girth_mm = map->columns * map->texel_mm;
  const int num_trees = static_cast<int>(std::lround(length_mm * girth_mm * 0.01 * style.trees_per_cm2));
  std::vector<Shoot> shoots;
  for (int tree = 0; tree < num_trees; ++tree) {
    shoots.push_back({rng.Uniform(0.0, length_mm), rng.Uniform(0.0, girth_mm), rng.Uniform(0.0, 2.0 * std::numbers::pi),
                      rng.Uniform(style.min_trunk_width_mm, style.max_trunk_width_mm),
                      rng.Uniform(style.min_trunk_length_mm, style.max_trunk_length_mm),
                      rng.Uniform(style.min_opacity, style.max_opacity), 0});
    while (!shoots.empty()) {
      const Shoot shoot = shoots.back();
      shoots.pop_back();
      Grow(shoot, rng, map, &shoots);
    }
  }
}

}  // namespace haustra::render
