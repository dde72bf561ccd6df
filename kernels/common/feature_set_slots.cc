#include "kernels/common/feature_set_slots.h"

#include <algorithm>
#include <functional>

namespace haustra::kernels {

FeatureSetSlots::FeatureSetSlots(int num_slots)
    : tags_(num_slots), num_features_(num_slots, 0), num_owners_(num_slots, 0) {
  free_.reserve(num_slots);
  for (int i = 0; i < num_slots; ++i) {
    tags_[i].store(TagOf(0, kFree), std::memory_order_relaxed);
    free_.push_back(static_cast<std::uint32_t>(i));
  }
  std::make_heap(free_.begin(), free_.end(), std::greater<>());
}

FeatureSetHandle FeatureSetSlots::Create() {
  const std::lock_guard lock(mutex_);
  if (free_.empty()) return {};
  std::pop_heap(free_.begin(), free_.end(), std::greater<>());
  const std::uint32_t index = free_.back();
  free_.pop_back();
  const std::uint32_t generation = static_cast<std::uint32_t>(tags_[index].load(std::memory_order_relaxed) >> 2);
  num_features_[index] = 0;
  num_owners_[index] = 1;
  tags_[index].store(TagOf(generation, kEmpty), std::memory_order_release);
  return {index, generation};
}

bool FeatureSetSlots::Retain(FeatureSetHandle handle) {
  const std::lock_guard lock(mutex_);
  if (NumFeatures(handle) < 0) return false;
  ++num_owners_[handle.index];
  return true;
}

void FeatureSetSlots::Release(FeatureSetHandle handle) {
  const std::lock_guard lock(mutex_);
  if (NumFeatures(handle) < 0 || --num_owners_[handle.index] > 0) return;
  tags_[handle.index].store(TagOf(handle.generation + 1, kFree), std::memory_order_release);
  if (handle.generation + 1 == 0xffffffffu) return;  // retired: its generation would wrap
  free_.push_back(handle.index);
  std::push_heap(free_.begin(), free_.end(), std::greater<>());
}

std::int32_t FeatureSetSlots::num_free() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::int32_t>(free_.size());
}

std::int32_t FeatureSetSlots::NumFeatures(FeatureSetHandle handle) const {
  if (handle.index >= tags_.size()) return -1;
  const std::uint64_t tag = tags_[handle.index].load(std::memory_order_acquire);
  if ((tag >> 2) != handle.generation || (tag & 3) == kFree) return -1;
  return (tag & 3) == kFilled ? num_features_[handle.index] : 0;
}

FeatureSetSlots::WriteClaim FeatureSetSlots::BeginWrite(FeatureSetHandle handle) {
  if (NumFeatures(handle) < 0) return WriteClaim::kStale;
  std::uint64_t expected = TagOf(handle.generation, kEmpty);
  return tags_[handle.index].compare_exchange_strong(expected, TagOf(handle.generation, kWriting))
             ? WriteClaim::kGranted
             : WriteClaim::kWrittenBefore;
}

void FeatureSetSlots::Publish(FeatureSetHandle handle, std::int32_t num_features) {
  std::uint64_t expected = TagOf(handle.generation, kWriting);
  num_features_[handle.index] = num_features;
  tags_[handle.index].compare_exchange_strong(expected, TagOf(handle.generation, kFilled));
}

void FeatureSetSlots::AbandonWrite(FeatureSetHandle handle) {
  std::uint64_t expected = TagOf(handle.generation, kWriting);
  tags_[handle.index].compare_exchange_strong(expected, TagOf(handle.generation, kEmpty));
}

}  // namespace haustra::kernels
