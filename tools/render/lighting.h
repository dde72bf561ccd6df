// Light of the tip on wet mucosa: a ring of small lamps beside the lens with inverse-square fall-off, soft tissue below
// a film of water that mirrors them, and light that the walls throw at each other. Camera coordinates, mm. reentrant.
#pragma once

#include <Eigen/Core>

#include "tools/render/instrument.h"
#include "tools/render/mucosa_texture.h"

namespace haustra::render {

// A place on the wall as one pixel sees it.
struct SurfacePoint {
  Eigen::Vector3f position;
  Eigen::Vector3f normal;  // of the wall, unit, into the lumen
  Eigen::Vector3f along;   // unit, tangent to the wall, increasing u
  Eigen::Vector3f around;  // unit, tangent to the wall, increasing v
  float openness = 1.0f;
  float footprint_mm = 0.0f;   // short axis of what the pixel covers
  float girth_stretch = 1.0f;  // texture mm per wall mm around the girth
};

// Linear radiance towards the camera, red first; 1 is about what a matt white wall at 20 mm gives. The instrument
// throws shadows: what the walls throw at each other goes around it.
void Shade(const SurfacePoint& point, const MucosaSample& mucosa, const InstrumentShape& instrument, float rgb[3]);
// The same of the instrument: dull metal, its shaft a coil.
void ShadeInstrument(const Eigen::Vector3f& ray, const InstrumentHit& hit, float rgb[3]);

}  // namespace haustra::render
