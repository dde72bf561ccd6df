// Guided matching on the CPU: every projected point against the keypoints in its window, found through the buckets of
// the feature set. The result does not depend on the number of threads or the SIMD level.
#pragma once

#include <cstdint>

#include "hal/vision_device.h"
#include "kernels/cpu/aligned_buffer.h"
#include "kernels/cpu/feature_set_pool.h"
#include "kernels/cpu/lane_pool.h"
#include "kernels/cpu/match_kernels.h"

namespace haustra::kernels {

// thread-bound(one lane); Match does not allocate.
class GuidedMatcher {
 public:
  // `sets` and `pool` must outlive the matcher.
  GuidedMatcher(const VisionPlan& plan, const FeatureSetPool& sets, SimdLevel level, LanePool& pool, Lane lane);

  static std::size_t BytesFor(const VisionPlan& plan);
  // Touches all memory.
  void Prefault();

  // The request must have been checked: at most plan.max_match_list queries, `train` alive, train_allowed long enough.
  // Returns the number of matches.
  int Match(const GuidedMatchRequest& request);

 private:
  TwoNearest MatchOne(const GuidedQuery& query, const FeatureSet& train, const GuidedMatchRequest& request) const;

  const FeatureSetPool& sets_;
  const MatchKernels& kernels_;
  LanePool& pool_;
  Lane lane_;
  AlignedBuffer<TwoNearest> results_;
  AlignedBuffer<std::int32_t> owners_;  // query that holds each feature of the train set
};

}  // namespace haustra::kernels
