// Fixed number of slots, handed out by handle. Memory is taken once at construction; nothing grows.
// Full: Insert returns a default (invalid) handle and counts it; the owner's policy decides what happens next.
// Slots are handed out lowest index first, so that the same operations give the same handles on every run.
// thread-bound(owner); Get is safe from other threads only while the owner does not insert or release.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory_resource>
#include <utility>
#include <vector>

#include "hal/core/check.h"
#include "hal/core/handle.h"
#include "hal/core/memory_arena.h"

namespace haustra {

template <typename T, typename Tag>
class SlotPool {
 public:
  using HandleType = Handle<Tag>;

  // Every value is made from `args`; values that own memory take it from `memory` when they are told so there.
  template <typename... Args>
  explicit SlotPool(std::uint32_t capacity, std::pmr::memory_resource* memory = std::pmr::get_default_resource(),
                    const Args&... args)
      : values_(memory), generations_(capacity, 0, memory), used_(capacity, 0, memory), free_(memory) {
    values_.reserve(capacity);
    for (std::uint32_t i = 0; i < capacity; ++i) values_.emplace_back(args...);
    free_.reserve(capacity);
    for (std::uint32_t i = 0; i < capacity; ++i) free_.push_back(i);
    std::make_heap(free_.begin(), free_.end(), std::greater<>());
  }

  // What a pool takes from its arena, without memory that its values own.
  static std::size_t BytesFor(std::size_t capacity) {
    return MemoryArena::BytesFor<T>(capacity) + 2 * MemoryArena::BytesFor<std::uint32_t>(capacity) +
           MemoryArena::BytesFor<std::uint8_t>(capacity);
  }

  // The slot's value keeps what its last user left: assign every field.
  HandleType Insert() {
    if (free_.empty()) {
      ++num_refused_;
      return HandleType{};
    }
    std::pop_heap(free_.begin(), free_.end(), std::greater<>());
    const std::uint32_t index = free_.back();
    free_.pop_back();
    used_[index] = 1;
    ++size_;
    high_water_ = std::max(high_water_, size_);
    return HandleType{index, generations_[index]};
  }

  // Returns false when the handle is stale or invalid. A slot whose generation would wrap is retired.
  bool Release(HandleType handle) {
    if (!Contains(handle)) return false;
    used_[handle.index] = 0;
    --size_;
    if (++generations_[handle.index] == 0xffffffffu) return true;
    free_.push_back(handle.index);
    std::push_heap(free_.begin(), free_.end(), std::greater<>());
    return true;
  }

  bool Contains(HandleType handle) const {
    return handle.index < values_.size() && used_[handle.index] != 0 && generations_[handle.index] == handle.generation;
  }
  // nullptr when stale or invalid.
  T* Get(HandleType handle) { return Contains(handle) ? &values_[handle.index] : nullptr; }
  const T* Get(HandleType handle) const { return Contains(handle) ? &values_[handle.index] : nullptr; }
  // For handles that the caller knows to be alive: a stale one is a programmer error.
  T& At(HandleType handle) {
    HAUSTRA_CHECK(Contains(handle));
    return values_[handle.index];
  }
  const T& At(HandleType handle) const {
    HAUSTRA_CHECK(Contains(handle));
    return values_[handle.index];
  }

  // Calls visit(handle, value) in slot order. The visitor may release the slot it is given, nothing else.
  template <typename Visitor>
  void ForEach(Visitor&& visit) {
    for (std::uint32_t i = 0; i < values_.size(); ++i) {
      if (used_[i] != 0) visit(HandleType{i, generations_[i]}, values_[i]);
    }
  }
  template <typename Visitor>
  void ForEach(Visitor&& visit) const {
    for (std::uint32_t i = 0; i < values_.size(); ++i) {
      if (used_[i] != 0) visit(HandleType{i, generations_[i]}, values_[i]);
    }
  }

  std::uint32_t size() const { return size_; }
  std::uint32_t capacity() const { return static_cast<std::uint32_t>(values_.size()); }
  std::uint32_t high_water() const { return high_water_; }
  std::uint64_t num_refused() const { return num_refused_; }

 private:
  std::pmr::vector<T> values_;
  std::pmr::vector<std::uint32_t> generations_;
  std::pmr::vector<std::uint8_t> used_;
  std::pmr::vector<std::uint32_t> free_;  // min-heap of free indices
  std::uint32_t size_ = 0;
  std::uint32_t high_water_ = 0;
  std::uint64_t num_refused_ = 0;
};

}  // namespace haustra
