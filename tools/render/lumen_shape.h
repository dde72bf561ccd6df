// Shape of the lumen about the centre line: radius of the wall as a function of arc length and angle, with haustral
// folds between three taeniae (so that the opening of a fold is a rounded triangle), an uneven wall and a few polyps.
// Lengths in mm, angles in rad about the tangent, from the normal towards the binormal. Immutable; reentrant.
#pragma once

#include <vector>

#include "engine/geometry/rng.h"
#include "tools/render/lattice_noise.h"
#include "tools/render/twin_segment.h"

namespace haustra::render {

class LumenShape {
 public:
  struct Style {
    double min_radius_mm = 21.5, max_radius_mm = 26.0;    // between folds
    double min_opening_mm = 11.5, max_opening_mm = 16.5;  // of a fold: from the centre line to the crest
    double min_fold_spacing_mm = 12.0, max_fold_spacing_mm = 22.0;
    double polyps_per_mm = 0.02;
  };
  LumenShape(const Style& style, double length_mm, const TwinSegment& twin, Rng& rng);

  // Never below min_opening_mm less the unevenness (about 1 mm).
  double Radius(double arc_mm, double angle_rad) const;
  // 0 to 1 over a polyp, 0 elsewhere: polyps are redder.
  double PolypWeight(double arc_mm, double angle_rad) const;
  double min_opening_mm() const { return style_.min_opening_mm; }

 private:
  struct Fold {
    double arc_mm, half_width_mm, opening_mm[3], tilt_mm, tilt_angle_rad;
    double straightness;  // of the crest between two taeniae: 1 a chord, 0 an arc
    double turn_rad;      // of the whole fold against the taeniae
  };
  struct Polyp {
    double arc_mm, angle_rad, radius_mm, height_mm;
  };
  double PlainRadius(double arc_mm, double angle_rad) const;

  Style style_;
  TwinSegment twin_;
  double taenia_angle_rad_;
  std::vector<Fold> folds_;  // in order of arc length
  std::vector<Polyp> polyps_;
  Wander girth_, twist_;
  GradientNoise swell_, ripple_;
};

}  // namespace haustra::render
