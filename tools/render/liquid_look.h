// How the liquid that stands in the colon looks: turbid, yellow-brown, and a mirror at flat angles. reentrant.
#pragma once

#include <array>

#include "tools/render/fluid_level.h"
#include "tools/render/mucosa_texture.h"

namespace haustra::render {

// What a ray sees of the liquid it enters.
struct LiquidLook {
  MucosaSample sample;           // its surface and what it scatters back, as of something wet that light falls on
  std::array<float, 3> through;  // of the light of what lies behind it
};

// path_mm: of the ray in the liquid; light goes this way twice, since lamps and lens stand side by side (law of Beer
// and Lambert). cosine: of the angle between the ray and the normal of the surface (Fresnel, as approximated by Schlick
// 1994). level_cosine: the same without ripples. Deep liquid is as bright at flat angles as at steep ones (law of
// Lommel and Seeliger).
LiquidLook LookInto(const LiquidSurface& surface, float path_mm, float cosine, float level_cosine);

// Slope of the surface towards a wall, where it creeps up by capillarity. wall_slope: of the wall there, 0: level.
// A pixel of footprint_mm averages it.
float MeniscusSlope(float wall_slope, float to_shore_mm, float footprint_mm);

}  // namespace haustra::render
