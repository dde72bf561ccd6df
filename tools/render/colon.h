// The shape of one colon: centre line, lumen and the wall's mesh, and how it moves. All of it is drawn from a seed.
// Lengths in mm, world frame. Immutable after construction; reentrant.
#pragma once

#include <cstdint>
#include <vector>

#include "tools/render/breathing.h"
#include "tools/render/centreline.h"
#include "tools/render/colon_mesh.h"
#include "tools/render/fluid_level.h"
#include "tools/render/lumen_shape.h"
#include "tools/render/twin_segment.h"

namespace haustra::render {

struct ColonStyle {
  double length_mm = 300.0;  // of the centre line
  double dome_mm = 19.0;     // depth of the blind end
  double max_curvature_per_mm = 1.0 / 65.0;
  LumenShape::Style lumen;
  TwinSegment twin;
  std::vector<Flexure> flexures;
  Breathing breathing;
  // The colon of the seed as it is another day: the radius of its wall differs by up to this share, [0, kMaxRemodel],
  // smoothly from place to place. The mucosa stays on the wall.
  double remodel = 0.0;
  std::uint64_t remodel_seed = 0;
  static constexpr double kMaxRemodel = 0.15;
  double fluid = 0.0;  // depth of the pools of liquid over the usual radius, [0, FluidLevel::kMaxShare]
};

class Colon {
 public:
  Colon(const ColonStyle& style, std::uint64_t seed);

  const ColonStyle& style() const { return style_; }
  const Centreline& centreline() const { return centreline_; }
  const LumenShape& lumen() const { return lumen_; }
  const ColonMesh& mesh() const { return mesh_; }
  const FluidLevel& fluid() const { return fluid_; }

 private:
  ColonStyle style_;
  Rng rng_;  // the members below draw from it in order
  Centreline centreline_;
  LumenShape lumen_;
  ColonMesh mesh_;
  FluidLevel fluid_;
};

}  // namespace haustra::render
