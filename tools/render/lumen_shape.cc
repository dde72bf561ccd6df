#include "tools/render/lumen_shape.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace haustra::render {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kSector = 2.0 * kPi / 3.0;
constexpr int kSwellCells = 9;    // around the girth: bulges of about 16 mm
constexpr int kRippleCells = 34;  // unevenness of about 4 mm
constexpr double kMeanRadiusMm = 22.0;

double WrapAngle(double a) { return a - 2.0 * kPi * std::floor((a + kPi) / (2.0 * kPi)); }

// Polynomial smooth minimum: equals min(a, b) where they differ by more than k.
double SmoothMin(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - 0.25 * h * h * k;
}

}  // namespace

LumenShape::LumenShape(const Style& style, double length_mm, const TwinSegment& twin, Rng& rng)
    : style_(style),
      twin_(twin),
      taenia_angle_rad_(rng.Uniform(0.0, kSector)),
      girth_(rng, 1.0 / 160.0, 1.0 / 45.0),
      twist_(rng, 1.0 / 300.0, 1.0 / 120.0),
      swell_(rng.Next(), kSwellCells),
      ripple_(rng.Next(), kRippleCells) {
  for (double s = -5.0; s < length_mm + 20.0; s += rng.Uniform(style.min_fold_spacing_mm, style.max_fold_spacing_mm)) {
    Fold fold{};
    fold.arc_mm = s;
    fold.half_width_mm = rng.Uniform(1.9, 2.9);
    for (double& opening : fold.opening_mm) opening = rng.Uniform(style.min_opening_mm, style.max_opening_mm);
    // One side of most folds is shallow: folds are half moons, not rings.
    if (rng.Uniform() < 0.6) fold.opening_mm[rng.UniformInt(3)] += rng.Uniform(2.0, 5.0);
    fold.tilt_mm = rng.Uniform(0.0, 2.6);
    fold.tilt_angle_rad = rng.Uniform(0.0, 2.0 * kPi);
    fold.straightness = rng.Uniform(0.35, 0.9);
    fold.turn_rad = rng.Uniform(-0.22, 0.22);
    folds_.push_back(fold);
  }
  const int num_polyps = static_cast<int>(length_mm * style.polyps_per_mm);
  for (int i = 0; i < num_polyps; ++i) {
    const double radius = rng.Uniform(1.3, 2.8);
    polyps_.push_back({rng.Uniform(0.0, length_mm), rng.Uniform(-kPi, kPi), radius, radius * rng.Uniform(0.7, 1.0)});
  }
}

double LumenShape::PolypWeight(double arc_mm, double angle_rad) const {
  const auto weight = [&](double s) {
    double sum = 0.0;
    for (const Polyp& p : polyps_) {
      const double ds = s - p.arc_mm;
      if (std::abs(ds) > 2.0 * p.radius_mm) continue;
      const double dv = kMeanRadiusMm * WrapAngle(angle_rad - p.angle_rad);
      const double q = (ds * ds + dv * dv) / (p.radius_mm * p.radius_mm);
      sum += std::exp(-q * q);
    }
    return std::min(sum, 1.0);
  };
  return twin_.Blend(arc_mm, weight);
}

double LumenShape::PlainRadius(double s, double angle) const {
  const auto swell_at = [&](const GradientNoise& noise, int cells) {
    const double cell_mm = 2.0 * kPi * kMeanRadiusMm / cells;
    return noise.At(static_cast<float>(s / cell_mm), static_cast<float>((angle / (2.0 * kPi) + 1.0) * cells));
  };
  const double middle = 0.5 * (style_.min_radius_mm + style_.max_radius_mm);
  const double half = 0.5 * (style_.max_radius_mm - style_.min_radius_mm);
  const double taenia = taenia_angle_rad_ + 0.5 * twist_.At(s);
  // Which third of the girth, the angle from its middle in [-60, 60] degrees and from the nearest taenia.
  struct Place {
    int sector;
    double from_middle, from_taenia;
  };
  const auto place_at = [](double from_first_taenia) {
    const double turned = WrapAngle(from_first_taenia) + kPi;
    const int sector = std::min(static_cast<int>(turned / kSector), 2);
    const double from_middle = turned - (sector + 0.5) * kSector;
    return Place{sector, from_middle, 0.5 * kSector - std::abs(from_middle)};
  };

  double radius = middle + half * girth_.At(s) + 1.7 * swell_at(swell_, kSwellCells);
  radius -= 0.7 * std::exp(-std::pow(place_at(angle - taenia).from_taenia / 0.13, 2.0));
  double wall = radius;
  for (const Fold& fold : folds_) {
    const double centre = fold.arc_mm + fold.tilt_mm * std::cos(angle - fold.tilt_angle_rad);
    const double ds = s - centre;
    if (std::abs(ds) > 3.5 * fold.half_width_mm) continue;
    // A blend of the three chords that is smooth where two sectors meet.
    const Place place = place_at(angle - taenia - fold.turn_rad);
    const double here = fold.opening_mm[place.sector];
    const double next = fold.opening_mm[(place.sector + (place.from_middle > 0 ? 1 : 2)) % 3];
    const double share = 0.5 * std::exp(-std::pow(place.from_taenia / 0.28, 2.0));
    const double opening = (1.0 - share) * here + share * next;
    const double chord = opening / std::cos(place.from_middle * fold.straightness);
    const double crest = SmoothMin(chord, radius, 5.0);
    const double profile = std::exp(-std::pow(std::abs(ds) / fold.half_width_mm, 2.2));
    wall = std::min(wall, radius - profile * (radius - crest));
  }
  return wall + 0.28 * swell_at(ripple_, kRippleCells);
}

double LumenShape::Radius(double arc_mm, double angle_rad) const {
  const auto radius = [&](double s) {
    double r = PlainRadius(s, angle_rad);
    for (const Polyp& p : polyps_) {
      const double ds = s - p.arc_mm;
      if (std::abs(ds) > 2.0 * p.radius_mm) continue;
      const double dv = kMeanRadiusMm * WrapAngle(angle_rad - p.angle_rad);
      const double q = (ds * ds + dv * dv) / (p.radius_mm * p.radius_mm);
      // Not into the opening of a fold: the scope passes there.
      r -= std::min(p.height_mm * std::exp(-q * q), std::max(0.0, r - style_.min_opening_mm));
    }
    return r;
  };
  return twin_.Blend(arc_mm, radius);
}

}  // namespace haustra::render
