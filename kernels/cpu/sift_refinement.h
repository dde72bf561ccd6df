// Sub-pixel and sub-scale position of an extremum, and the tests that it has to pass (Lowe 2004, section 4).
#pragma once

#include <cstdint>

#include "kernels/cpu/sift_kernels.h"

namespace haustra::kernels {

// A point of the scale space, in octave pixels.
struct ScaleSpacePoint {
  float x = 0.0f;
  float y = 0.0f;
  float scale = 0.0f;     // octave pixels
  float response = 0.0f;  // |DoG| at the refined position
  std::int16_t octave = 0;
  std::int16_t level = 0;  // of the Gaussian image nearest in scale
  bool is_dark = false;    // darker than what is around it
};

struct RefinementOptions {
  float contrast_threshold = kDefaultContrastThreshold;
  float edge_threshold = 10.0f;
};

// `levels`: the kNumLevels Gaussian images of the octave. False when the extremum moves out of the octave or does not
// settle, has too little contrast, or lies on an edge; `point` is untouched then (octave is the caller's to fill in).
// reentrant, rt-safe.
bool RefineExtremum(const Plane* levels, const Extremum& extremum, const RefinementOptions& options,
                    ScaleSpacePoint* point);

}  // namespace haustra::kernels
