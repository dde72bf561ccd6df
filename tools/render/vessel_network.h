// Branching blood vessels of the mucosa, drawn into maps of the wall. Surface coordinates in mm: u along the wall, v
// around the girth with a period. reentrant.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/geometry/rng.h"

namespace haustra::render {

// One value a texel, row = u, column = v (periodic); 0: no vessel, 255: all vessel.
struct SurfaceMap {
  int rows = 0;
  int columns = 0;
  float texel_mm = 0.0f;
  std::vector<std::uint8_t> values;

  SurfaceMap(int num_rows, int num_columns, float texel_size_mm)
      : rows(num_rows), columns(num_columns), texel_mm(texel_size_mm), values(std::size_t(num_rows) * num_columns, 0) {}
};

struct VesselStyle {
  double trees_per_cm2 = 0.085;
  double min_trunk_width_mm = 0.24, max_trunk_width_mm = 0.62;
  double min_opacity = 0.45, max_opacity = 0.95;
  double min_trunk_length_mm = 25.0, max_trunk_length_mm = 65.0;
};

// Grows trees at random places: each vessel wanders, tapers and branches until it is a hair. Overlapping strokes keep
// the darker one.
void DrawVessels(const VesselStyle& style, Rng& rng, SurfaceMap* map);

}  // namespace haustra::render
