// What brute-force and guided matching share.
#pragma once

#include "kernels/cuda/match_kernels.h"

namespace haustra::kernels::cuda {

// Joins two results over different train descriptors; ties go to the lower index.
__device__ __forceinline__ void Join(TwoNearest& top, float best, float second, std::int32_t best_idx) {
  if (best > top.best || (best == top.best && best_idx < top.best_idx)) {
    top.second = fmaxf(top.best, second);
    top.best = best;
    top.best_idx = best_idx;
  } else {
    top.second = fmaxf(top.second, best);
  }
}

__device__ __forceinline__ MatchState Judge(const TwoNearest& top, const MatchOptions& options) {
  if (top.best_idx < 0 || top.best < 0.0f || top.best < options.min_similarity) return kRejected;
  if (options.max_angle_ratio >= 1.0f) return kAccepted;
  // The arc cosines of two libraries differ by some 1e-7.
  constexpr float kMargin = 1e-5f;
  const float excess =
      acosf(fminf(top.best, 1.0f)) - options.max_angle_ratio * acosf(fminf(fmaxf(top.second, 0.0f), 1.0f));
  if (fabsf(excess) < kMargin) return kBorderline;
  return excess <= 0.0f ? kAccepted : kRejected;
}

}  // namespace haustra::kernels::cuda
