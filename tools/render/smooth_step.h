// Soft thresholds of the renderer's fields.
#pragma once

#include <algorithm>

namespace haustra::render {

inline float Saturate(float x) { return std::clamp(x, 0.0f, 1.0f); }

// From 0 at `low` to 1 at `high`, flat at both ends.
inline float SmoothStep(float low, float high, float x) {
  const float t = Saturate((x - low) / (high - low));
  return t * t * (3.0f - 2.0f * t);
}

}  // namespace haustra::render
