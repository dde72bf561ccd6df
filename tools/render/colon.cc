#include "tools/render/colon.h"

namespace haustra::render {
namespace {

Centreline::Shape CurveShape(const ColonStyle& style) {
  Centreline::Shape shape;
  shape.length_mm = style.length_mm;
  shape.max_curvature_per_mm = style.max_curvature_per_mm;
  shape.clearance_mm = 2.0 * style.lumen.max_radius_mm + 6.0;
  shape.twin = style.twin;
  shape.flexures = style.flexures;
  return shape;
}

}  // namespace

Colon::Colon(const ColonStyle& style, std::uint64_t seed)
    : style_(style),
      rng_(seed, 0x5ce),
      centreline_(CurveShape(style), rng_),
      lumen_(style.lumen, style.length_mm, style.twin, rng_),
      mesh_(centreline_, lumen_, style.dome_mm),
      fluid_(style.fluid, centreline_, seed) {
  if (style.remodel > 0.0) mesh_.Remodel(style.remodel, style.remodel_seed, style.lumen.min_opening_mm);
}

}  // namespace haustra::render
