#include "kernels/cpu/feature_set_pool.h"

#include <algorithm>
#include <cmath>

namespace haustra::kernels {

namespace {

int NumBuckets(int size_px) { return (size_px + FeatureSetPool::kBucketPx - 1) / FeatureSetPool::kBucketPx; }

std::size_t NumStarts(const VisionPlan& plan) {
  return static_cast<std::size_t>(NumBuckets(plan.max_width_px)) * NumBuckets(plan.max_height_px) + 1;
}

}  // namespace

std::size_t FeatureSetPool::BytesFor(const VisionPlan& plan) {
  const std::size_t num_sets = plan.max_feature_sets;
  const std::size_t num_features = num_sets * plan.max_features;
  return AlignedBuffer<Keypoint>::BytesFor(num_features) +
         AlignedBuffer<std::uint8_t>::BytesFor(num_features * kDescriptorBytes) +
         AlignedBuffer<float>::BytesFor(num_features) +
         AlignedBuffer<std::int32_t>::BytesFor(num_sets * NumStarts(plan)) +
         AlignedBuffer<std::int32_t>::BytesFor(num_features) + num_sets * sizeof(FeatureSet) +
         FeatureSetSlots::BytesFor(plan.max_feature_sets);
}

FeatureSetPool::FeatureSetPool(const VisionPlan& plan)
    : num_bucket_columns_(NumBuckets(plan.max_width_px)),
      num_bucket_rows_(NumBuckets(plan.max_height_px)),
      sets_(plan.max_feature_sets),
      slots_(plan.max_feature_sets) {
  const std::size_t num_sets = plan.max_feature_sets;
  const std::size_t num_features = plan.max_features;
  const std::size_t num_starts = NumStarts(plan);
  keypoints_ = AlignedBuffer<Keypoint>(num_sets * num_features);
  descriptors_ = AlignedBuffer<std::uint8_t>(num_sets * num_features * kDescriptorBytes);
  inverse_norms_ = AlignedBuffer<float>(num_sets * num_features);
  bucket_starts_ = AlignedBuffer<std::int32_t>(num_sets * num_starts);
  bucket_features_ = AlignedBuffer<std::int32_t>(num_sets * num_features);
  keypoints_.SetZero();
  descriptors_.SetZero();
  inverse_norms_.SetZero();
  bucket_starts_.SetZero();
  bucket_features_.SetZero();
  for (std::size_t i = 0; i < num_sets; ++i) {
    sets_[i].keypoints = keypoints_.data() + i * num_features;
    sets_[i].descriptors = descriptors_.data() + i * num_features * kDescriptorBytes;
    sets_[i].inverse_norms = inverse_norms_.data() + i * num_features;
    sets_[i].bucket_starts = bucket_starts_.data() + i * num_starts;
    sets_[i].bucket_features = bucket_features_.data() + i * num_features;
  }
}

const FeatureSet* FeatureSetPool::Get(FeatureSetHandle handle) const {
  static constexpr FeatureSet kNoFeatures;
  const std::int32_t num_features = slots_.NumFeatures(handle);
  if (num_features < 0) return nullptr;
  return num_features > 0 ? &sets_[handle.index] : &kNoFeatures;
}

FeatureSet* FeatureSetPool::BeginWrite(FeatureSetHandle handle, bool* is_stale) {
  const FeatureSetSlots::WriteClaim claim = slots_.BeginWrite(handle);
  *is_stale = claim == FeatureSetSlots::WriteClaim::kStale;
  return claim == FeatureSetSlots::WriteClaim::kGranted ? &sets_[handle.index] : nullptr;
}

void FeatureSetPool::Publish(FeatureSetHandle handle, std::int32_t num_features) {
  FeatureSet& set = sets_[handle.index];
  set.num_features = num_features;
  for (int i = 0; i < num_features; ++i) {
    const std::uint8_t* d = set.descriptor(i);
    std::int32_t sum = 0;
    for (int k = 0; k < kDescriptorBytes; ++k) sum += d[k] * d[k];
    set.inverse_norms[i] = sum > 0 ? 1.0f / std::sqrt(static_cast<float>(sum)) : 0.0f;
  }
  FillBuckets(set);
  slots_.Publish(handle, num_features);
}

void FeatureSetPool::FillBuckets(FeatureSet& set) {
  const int num_buckets = num_bucket_columns_ * num_bucket_rows_;
  const auto bucket_of = [&](const Keypoint& keypoint) {
    const int column = static_cast<int>(std::clamp(keypoint.x_px / kBucketPx, 0.0f, num_bucket_columns_ - 1.0f));
    const int row = static_cast<int>(std::clamp(keypoint.y_px / kBucketPx, 0.0f, num_bucket_rows_ - 1.0f));
    return row * num_bucket_columns_ + column;
  };
  std::fill_n(set.bucket_starts, num_buckets + 1, 0);
  for (int i = 0; i < set.num_features; ++i) ++set.bucket_starts[bucket_of(set.keypoints[i]) + 1];
  for (int b = 0; b < num_buckets; ++b) set.bucket_starts[b + 1] += set.bucket_starts[b];
  // Backwards through the features and downwards in each bucket; the starts end up where they belong.
  for (int b = 0; b < num_buckets; ++b) set.bucket_starts[b] = set.bucket_starts[b + 1];
  for (int i = set.num_features - 1; i >= 0; --i) {
    set.bucket_features[--set.bucket_starts[bucket_of(set.keypoints[i])]] = i;
  }
}

}  // namespace haustra::kernels
