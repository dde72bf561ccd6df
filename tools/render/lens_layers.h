// The things that come between lens and scene, each drawn over a picture in linear light. reentrant.
#pragma once

#include <cstdint>
#include <span>

#include "tools/render/linear_image.h"

namespace haustra::render {

// A bubble or a fleck. Lengths are shares of the image height.
struct Drop {
  float x, y, radius;      // at birth
  float drift_x, drift_y;  // per second
  float birth_s, life_s;   // since the start of the event
};

struct LensMoment {
  std::uint32_t seed = 0;
  float alpha = 0.0f;    // how far the event has come on: 0 not at all, 1 fully
  float since_s = 0.0f;  // since its start
  float level = 0.0f;    // usual brightness of the scene
  std::span<const Drop> drops;
};

void DrawTissue(const LensMoment& moment, LinearImage* image);
void DrawWater(const LensMoment& moment, LinearImage* image);
void DrawFoam(const LensMoment& moment, LinearImage* image);
void DrawTurbidWater(const LensMoment& moment, LinearImage* image);

}  // namespace haustra::render
