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

// thread-bound(one lane); nothing but construction allocates.
class GuidedMatcher {
 public:
  // `sets` and `pool` must outlive the matcher, which uses the pool alone while a matching lasts.
  GuidedMatcher(const VisionPlan& plan, const FeatureSetPool& sets, SimdLevel level, LanePool& pool);

  static std::size_t BytesFor(const VisionPlan& plan);
  // Touches all memory.
  void Prefault();

  // The request must have been checked: at most plan.max_match_list queries, `train` alive, train_allowed long enough.
  // What it names stays until the matching is done or dropped. Forgets a matching whose loop was dropped.
  void Begin(const GuidedMatchRequest& request);
  // True when the matches are written. False when the deadline is over before; then it can be continued.
  bool Continue(TimePoint deadline);
  // Of the matching that is done.
  int num_matches() const { return num_matches_; }

 private:
  int Accept();
  TwoNearest MatchOne(const GuidedQuery& query) const;

  const FeatureSetPool& sets_;
  const MatchKernels& kernels_;
  LanePool& pool_;
  GuidedMatchRequest request_;
  const FeatureSet* train_ = nullptr;
  bool is_done_ = true;
  int num_matches_ = 0;
  AlignedBuffer<TwoNearest> results_;
  AlignedBuffer<std::int32_t> owners_;  // query that holds each feature of the train set
};

}  // namespace haustra::kernels
