#include "kernels/common/feature_set_slots.h"

#include <bit>

namespace haustra::kernels {
namespace {

constexpr std::size_t kBitsAWord = 64;
constexpr std::uint32_t kLastGeneration = 0xffffffffu;

std::size_t NumWords(int num_slots) { return (static_cast<std::size_t>(num_slots) + kBitsAWord - 1) / kBitsAWord; }

}  // namespace

std::size_t FeatureSetSlots::BytesFor(int num_slots) {
  return static_cast<std::size_t>(num_slots) * (sizeof(std::uint64_t) + sizeof(std::int32_t)) +
         NumWords(num_slots) * sizeof(std::uint64_t);
}

FeatureSetSlots::FeatureSetSlots(int num_slots)
    : tags_(num_slots), num_features_(num_slots, 0), free_(NumWords(num_slots)) {
  for (int i = 0; i < num_slots; ++i) {
    tags_[i].store(Tag{}.word(), std::memory_order_relaxed);
    free_[i / kBitsAWord].fetch_or(std::uint64_t{1} << (i % kBitsAWord), std::memory_order_relaxed);
  }
}

FeatureSetHandle FeatureSetSlots::Create() {
  for (std::size_t i = 0; i < free_.size(); ++i) {
    std::uint64_t word = free_[i].load(std::memory_order_relaxed);
    while (word != 0) {
      const std::uint64_t lowest = word & (~word + 1);
      if (!free_[i].compare_exchange_weak(word, word & ~lowest, std::memory_order_acquire)) continue;
      const auto index =
          static_cast<std::uint32_t>(i * kBitsAWord + static_cast<std::size_t>(std::countr_zero(lowest)));
      Tag tag = Tag::From(tags_[index].load(std::memory_order_relaxed));
      tag.num_owners = 1;
      tag.state = kEmpty;
      tags_[index].store(tag.word(), std::memory_order_release);
      return {index, tag.generation};
    }
  }
  return {};
}

template <typename Change>
bool FeatureSetSlots::Update(FeatureSetHandle handle, Change&& change) {
  if (handle.index >= tags_.size()) return false;
  std::atomic<std::uint64_t>& slot = tags_[handle.index];
  std::uint64_t word = slot.load(std::memory_order_acquire);
  while (true) {
    Tag tag = Tag::From(word);
    if (tag.generation != handle.generation || tag.state == kFree || !change(tag)) return false;
    if (slot.compare_exchange_weak(word, tag.word(), std::memory_order_acq_rel, std::memory_order_acquire)) return true;
  }
}

bool FeatureSetSlots::ChangeState(FeatureSetHandle handle, State from, State to) {
  return Update(handle, [&](Tag& tag) {
    if (tag.state != from) return false;
    tag.state = to;
    return true;
  });
}

bool FeatureSetSlots::Retain(FeatureSetHandle handle) {
  return Update(handle, [](Tag& tag) {
    ++tag.num_owners;
    return true;
  });
}

void FeatureSetSlots::Release(FeatureSetHandle handle) {
  bool is_last = false;
  const bool is_released = Update(handle, [&](Tag& tag) {
    is_last = --tag.num_owners == 0;
    if (is_last) tag = {tag.generation + 1, 0, kFree};
    return true;
  });
  if (!is_released || !is_last) return;
  if (handle.generation + 1 == kLastGeneration) return;  // retired: its generation would wrap
  free_[handle.index / kBitsAWord].fetch_or(std::uint64_t{1} << (handle.index % kBitsAWord), std::memory_order_release);
}

std::int32_t FeatureSetSlots::num_free() const {
  std::int32_t num = 0;
  for (const std::atomic<std::uint64_t>& word : free_) num += std::popcount(word.load(std::memory_order_relaxed));
  return num;
}

std::int32_t FeatureSetSlots::NumFeatures(FeatureSetHandle handle) const {
  if (handle.index >= tags_.size()) return -1;
  const Tag tag = Tag::From(tags_[handle.index].load(std::memory_order_acquire));
  if (tag.generation != handle.generation || tag.state == kFree) return -1;
  return tag.state == kFilled ? num_features_[handle.index] : 0;
}

FeatureSetSlots::WriteClaim FeatureSetSlots::BeginWrite(FeatureSetHandle handle) {
  if (NumFeatures(handle) < 0) return WriteClaim::kStale;
  return ChangeState(handle, kEmpty, kWriting) ? WriteClaim::kGranted : WriteClaim::kWrittenBefore;
}

void FeatureSetSlots::Publish(FeatureSetHandle handle, std::int32_t num_features) {
  num_features_[handle.index] = num_features;
  ChangeState(handle, kWriting, kFilled);
}

void FeatureSetSlots::AbandonWrite(FeatureSetHandle handle) { ChangeState(handle, kWriting, kEmpty); }

}  // namespace haustra::kernels
