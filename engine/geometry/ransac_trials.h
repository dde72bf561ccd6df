// When RANSAC may stop (Fischler and Bolles 1981).
#pragma once

#include <algorithm>
#include <cmath>

namespace haustra {

// Trials after which a sample without outliers has been drawn with probability `confidence`, at most `max_trials`.
inline int RansacTrials(int num_inliers, int num_matches, int sample_size, double confidence, int max_trials) {
  const double share = static_cast<double>(num_inliers) / num_matches;
  const double clean = std::pow(share, sample_size);
  if (!(clean > 1e-12)) return max_trials;
  if (clean >= 1.0) return 1;
  const double trials = std::ceil(std::log(1.0 - confidence) / std::log1p(-clean));
  return static_cast<int>(std::clamp(trials, 1.0, static_cast<double>(max_trials)));
}

}  // namespace haustra
