// The fixed pool of feature sets of the CPU device: their memory, taken at construction, and their life
// (kernels/common/feature_set_slots.h). thread-safe: looking up a handle takes no lock.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/vision_device.h"
#include "kernels/common/feature_set_slots.h"
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

  // Touches all of it, so that no frame pays for the pages of its set.
  explicit FeatureSetPool(const VisionPlan& plan);
  static std::size_t BytesFor(const VisionPlan& plan);

  FeatureSetHandle Create() { return slots_.Create(); }
  bool Retain(FeatureSetHandle handle) { return slots_.Retain(handle); }
  void Release(FeatureSetHandle handle) { slots_.Release(handle); }
  std::int32_t num_free() const { return slots_.num_free(); }

  // nullptr when the handle is stale or invalid. A set that nobody has written yet has no features.
  const FeatureSet* Get(FeatureSetHandle handle) const;

  // Claims an empty set for writing: nullptr when stale (is_stale) or written before. Publish makes it readable: it
  // computes norms and buckets of the num_features that the writer filled in.
  FeatureSet* BeginWrite(FeatureSetHandle handle, bool* is_stale);
  void Publish(FeatureSetHandle handle, std::int32_t num_features);
  // Gives up a claim: the set is empty again.
  void AbandonWrite(FeatureSetHandle handle) { slots_.AbandonWrite(handle); }

  int num_bucket_columns() const { return num_bucket_columns_; }
  int num_bucket_rows() const { return num_bucket_rows_; }

 private:
  void FillBuckets(FeatureSet& set);

  int num_bucket_columns_;
  int num_bucket_rows_;
  AlignedBuffer<Keypoint> keypoints_;
  AlignedBuffer<std::uint8_t> descriptors_;
  AlignedBuffer<float> inverse_norms_;
  AlignedBuffer<std::int32_t> bucket_starts_;
  AlignedBuffer<std::int32_t> bucket_features_;
  std::vector<FeatureSet> sets_;
  FeatureSetSlots slots_;
};

}  // namespace haustra::kernels
