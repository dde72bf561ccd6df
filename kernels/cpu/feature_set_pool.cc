#include "kernels/cpu/feature_set_pool.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace haustra::kernels {

FeatureSetPool::FeatureSetPool(const VisionPlan& plan)
    : num_bucket_columns_((plan.max_width_px + kBucketPx - 1) / kBucketPx),
      num_bucket_rows_((plan.max_height_px + kBucketPx - 1) / kBucketPx),
      sets_(plan.max_feature_sets),
      tags_(plan.max_feature_sets),
      num_owners_(plan.max_feature_sets, 0) {
  const std::size_t num_sets = plan.max_feature_sets;
  const std::size_t num_features = plan.max_features;
  const std::size_t num_starts = static_cast<std::size_t>(num_bucket_columns_) * num_bucket_rows_ + 1;
  keypoints_ = AlignedBuffer<Keypoint>(num_sets * num_features);
  descriptors_ = AlignedBuffer<std::uint8_t>(num_sets * num_features * kDescriptorBytes);
  inverse_norms_ = AlignedBuffer<float>(num_sets * num_features);
  bucket_starts_ = AlignedBuffer<std::int32_t>(num_sets * num_starts);
  bucket_features_ = AlignedBuffer<std::int32_t>(num_sets * num_features);
  free_.reserve(num_sets);
  for (std::size_t i = 0; i < num_sets; ++i) {
    sets_[i].keypoints = keypoints_.data() + i * num_features;
    sets_[i].descriptors = descriptors_.data() + i * num_features * kDescriptorBytes;
    sets_[i].inverse_norms = inverse_norms_.data() + i * num_features;
    sets_[i].bucket_starts = bucket_starts_.data() + i * num_starts;
    sets_[i].bucket_features = bucket_features_.data() + i * num_features;
    tags_[i].store(TagOf(0, kFree), std::memory_order_relaxed);
    free_.push_back(static_cast<std::uint32_t>(i));
  }
  std::make_heap(free_.begin(), free_.end(), std::greater<>());
}

FeatureSetHandle FeatureSetPool::Create() {
  const std::lock_guard lock(mutex_);
  if (free_.empty()) return {};
  std::pop_heap(free_.begin(), free_.end(), std::greater<>());
  const std::uint32_t index = free_.back();
  free_.pop_back();
  const std::uint32_t generation = static_cast<std::uint32_t>(tags_[index].load(std::memory_order_relaxed) >> 2);
  sets_[index].num_features = 0;
  num_owners_[index] = 1;
  tags_[index].store(TagOf(generation, kEmpty), std::memory_order_release);
  return {index, generation};
}

bool FeatureSetPool::Retain(FeatureSetHandle handle) {
  const std::lock_guard lock(mutex_);
  if (Get(handle) == nullptr) return false;
  ++num_owners_[handle.index];
  return true;
}

void FeatureSetPool::Release(FeatureSetHandle handle) {
  const std::lock_guard lock(mutex_);
  if (Get(handle) == nullptr || --num_owners_[handle.index] > 0) return;
  tags_[handle.index].store(TagOf(handle.generation + 1, kFree), std::memory_order_release);
  if (handle.generation + 1 == 0xffffffffu) return;  // retired: its generation would wrap
  free_.push_back(handle.index);
  std::push_heap(free_.begin(), free_.end(), std::greater<>());
}

std::int32_t FeatureSetPool::num_free() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::int32_t>(free_.size());
}

const FeatureSet* FeatureSetPool::Get(FeatureSetHandle handle) const {
  static constexpr FeatureSet kNoFeatures;
  if (handle.index >= tags_.size()) return nullptr;
  const std::uint64_t tag = tags_[handle.index].load(std::memory_order_acquire);
  if ((tag >> 2) != handle.generation || (tag & 3) == kFree) return nullptr;
  return (tag & 3) == kFilled ? &sets_[handle.index] : &kNoFeatures;
}

FeatureSet* FeatureSetPool::BeginWrite(FeatureSetHandle handle, bool* is_stale) {
  *is_stale = Get(handle) == nullptr;
  if (*is_stale) return nullptr;
  std::uint64_t expected = TagOf(handle.generation, kEmpty);
  if (!tags_[handle.index].compare_exchange_strong(expected, TagOf(handle.generation, kWriting))) return nullptr;
  return &sets_[handle.index];
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
  tags_[handle.index].store(TagOf(handle.generation, kFilled), std::memory_order_release);
}

void FeatureSetPool::AbandonWrite(FeatureSetHandle handle) {
  tags_[handle.index].store(TagOf(handle.generation, kEmpty), std::memory_order_release);
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
