// The tests that the best candidate of a query has to pass, for brute-force and guided matching alike.
#pragma once

#include <algorithm>
#include <cmath>

#include "hal/vision_device.h"

namespace haustra::kernels {

// second < 0: there is none, which counts as a similarity of 0.
inline bool IsAccepted(float best, float second, const MatchOptions& options) {
  if (best < 0.0f || best < options.min_similarity) return false;
  if (options.max_angle_ratio >= 1.0f) return true;
  return std::acos(std::min(best, 1.0f)) <= options.max_angle_ratio * std::acos(std::clamp(second, 0.0f, 1.0f));
}

}  // namespace haustra::kernels
