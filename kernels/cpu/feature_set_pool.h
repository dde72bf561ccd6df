// The fixed pool of feature sets of the CPU device. Memory of all sets is taken at construction. Full: Create returns
// an invalid handle. Slots are handed out lowest index first, so the same calls give the same handles on every run.
// thread-safe: looking up a handle takes no lock.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "hal/vision_device.h"
#include "kernels/cpu/aligned_buffer.h"

namespace haustra::kernels {

// Keypoints and descriptors of one image, in place in the pool's memory; num_features of each. Descriptors are N x 128
// u8, row-major, 64-byte aligned. The buckets sort the features by squares of kBucketPx pixels: features of bucket b
// are bucket_features[bucket_starts[b] .. bucket_starts[b + 1]), ascending.
struct FeatureSet {
  std::int32_t num_features = 0;
  Keypoint* keypoints = nullptr;
  std::uint8_t* descriptors = nullptr;
  float* inverse_norms = nullptr;  // 1 / |descriptor|, 0 for a descriptor of zeros
  std::int32_t* bucket_starts = nullptr;
  std::int32_t* bucket_features = nullptr;

  const std::uint8_t* descriptor(int i) const { return descriptors + static_cast<std::size_t>(i) * kDescriptorBytes; }
  std::uint8_t* descriptor(int i) { return descriptors + static_cast<std::size_t>(i) * kDescriptorBytes; }
};

class FeatureSetPool {
 public:
  static constexpr int kBucketPx = 16;

  explicit FeatureSetPool(const VisionPlan& plan);

  FeatureSetHandle Create();  // with one owner
  bool Retain(FeatureSetHandle handle);
  void Release(FeatureSetHandle handle);
  std::int32_t num_free() const;

  // nullptr when the handle is stale or invalid. A set that nobody has written yet has no features.
  const FeatureSet* Get(FeatureSetHandle handle) const;

  // Claims an empty set for writing: nullptr when stale (is_stale) or written before. Publish makes it readable: it
  // computes norms and buckets of the num_features that the writer filled in.
  FeatureSet* BeginWrite(FeatureSetHandle handle, bool* is_stale);
  void Publish(FeatureSetHandle handle, std::int32_t num_features);
  // Gives up a claim: the set is empty again.
  void AbandonWrite(FeatureSetHandle handle);

  int num_bucket_columns() const { return num_bucket_columns_; }
  int num_bucket_rows() const { return num_bucket_rows_; }

 private:
  enum State : std::uint64_t { kFree = 0, kEmpty = 1, kWriting = 2, kFilled = 3 };
  static std::uint64_t TagOf(std::uint32_t generation, State state) {
    return (static_cast<std::uint64_t>(generation) << 2) | state;
  }
  void FillBuckets(FeatureSet& set);

  int num_bucket_columns_;
  int num_bucket_rows_;
  AlignedBuffer<Keypoint> keypoints_;
  AlignedBuffer<std::uint8_t> descriptors_;
  AlignedBuffer<float> inverse_norms_;
  AlignedBuffer<std::int32_t> bucket_starts_;
  AlignedBuffer<std::int32_t> bucket_features_;
  std::vector<FeatureSet> sets_;
  std::vector<std::atomic<std::uint64_t>> tags_;  // generation and state of each slot
  mutable std::mutex mutex_;                      // guards num_owners_ and free_ (a min-heap of slots)
  std::vector<std::uint32_t> num_owners_;
  std::vector<std::uint32_t> free_;
};

}  // namespace haustra::kernels
