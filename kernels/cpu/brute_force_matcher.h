// Brute-force matching of descriptor lists on the CPU: every pair, exact integer products, best and second best in one
// pass. The result does not depend on the number of threads or the SIMD level.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/vision_device.h"
#include "kernels/cpu/aligned_buffer.h"
#include "kernels/cpu/feature_set_pool.h"
#include "kernels/cpu/lane_pool.h"
#include "kernels/cpu/match_kernels.h"

namespace haustra::kernels {

// thread-bound(one lane); nothing but construction allocates.
class BruteForceMatcher {
 public:
  // `sets` and `pool` must outlive the matcher, which uses the pool alone while a matching lasts. max_list: longest
  // list of either side.
  BruteForceMatcher(int max_list, const FeatureSetPool& sets, SimdLevel level, LanePool& pool);

  static std::size_t BytesFor(int max_list, int num_threads);
  // Touches all memory.
  void Prefault();

  // Number of entries of a list; -1: the handle is stale.
  static int ListSize(const DescriptorList& list, const FeatureSetPool& sets);

  // The request must have been checked: lists of at most max_list entries, handles alive, indices in range, bearings
  // and tolerances for every feature, no gate on gathered lists. What it names stays until the matching is done or
  // dropped. Forgets a matching whose loop was dropped.
  void Begin(const MatchRequest& request);
  // True when the matches are written. False when the deadline is over before; then it can be continued. The deadline
  // is looked at about once a millisecond.
  bool Continue(TimePoint deadline);
  // Of the matching that is done.
  int num_matches() const { return num_matches_; }

 private:
  struct Entry {
    const FeatureSet* set = nullptr;  // nullptr: stale
    std::int32_t feature_idx = 0;
  };

  enum class Step { kPackQueries, kPackTrain, kCompare, kAccept, kDone };

  void Advance();
  Entry EntryOf(const DescriptorList& list, const FeatureSet* set, int position) const;
  void PackQueries(const DescriptorList& list, int size);
  void PackTrain(const DescriptorList& list, int size);
  void PackGates();
  void BeginComparisons();
  TrainBest TrainBestOf(int worker);
  void JoinTrainBest();
  int Accept() const;

  const FeatureSetPool& sets_;
  const MatchKernels& kernels_;
  LanePool& pool_;

  // The matching.
  Step step_ = Step::kDone;
  MatchRequest request_;
  DisparityWindow disparity_;  // of the request
  EpipolarGate epipolar_;      // of the request
  int num_queries_ = 0;
  int num_train_ = 0;
  int num_matches_ = 0;

  AlignedBuffer<std::uint8_t> query_bytes_;
  AlignedBuffer<float> query_inverse_norms_;
  AlignedBuffer<std::uint8_t> query_is_valid_;
  AlignedBuffer<GatePoint> query_gates_;
  AlignedBuffer<std::uint8_t> train_bytes_;
  AlignedBuffer<std::int32_t> train_sums_;
  AlignedBuffer<float> train_inverse_norms_;
  AlignedBuffer<std::int32_t> train_is_valid_;
  AlignedBuffer<GateBlock> train_gates_;
  AlignedBuffer<TwoNearest> results_;
  // Of the queries that each worker has compared, then joined into the first.
  std::vector<std::uint8_t> has_train_best_;
  std::vector<AlignedBuffer<float>> train_best_similarity_;
  std::vector<AlignedBuffer<std::int32_t>> train_best_query_;
};

}  // namespace haustra::kernels
