// Latest-value mailbox (triple buffer): one writer publishes whole values, one reader takes the newest; neither waits.
// The writer fills WriteSlot() and calls Publish(). The reader's slot stays untouched until its next Refresh().
// Three values of T, taken at construction. writer and reader: one thread each; both sides are wait-free and rt-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory_resource>
#include <vector>

#include "hal/core/memory_arena.h"

namespace haustra {

template <typename T>
class LatestMailbox {
 public:
  static constexpr std::size_t kNumSlots = 3;

  LatestMailbox() : slots_(kNumSlots) {}
  // Three copies of the prototype, so that values which own memory have it from the start.
  explicit LatestMailbox(const T& prototype) : slots_(kNumSlots, prototype) {}
  // Three values made from `args`; values that own memory take it from `memory` when they are told so there.
  template <typename... Args>
  explicit LatestMailbox(std::pmr::memory_resource* memory, const Args&... args) : slots_(memory) {
    slots_.reserve(kNumSlots);
    for (std::size_t i = 0; i < kNumSlots; ++i) slots_.emplace_back(args...);
  }

  // What a mailbox takes from its arena, without memory that its values own.
  static constexpr std::size_t BytesFor() { return MemoryArena::BytesFor<T>(kNumSlots); }

  // Writer. What the slot holds on entry is an older value: overwrite every field that is read.
  T& WriteSlot() { return slots_[write_]; }
  void Publish() {
    const std::uint32_t former = middle_.exchange(write_ | kFresh, std::memory_order_acq_rel);
    write_ = former & kIndexMask;
  }

  // Reader. Returns true when a newer value has come since the last call.
  bool Refresh() {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    const std::uint32_t former = middle_.exchange(read_, std::memory_order_acq_rel);
    read_ = former & kIndexMask;
    return true;
  }
  const T& ReadSlot() const { return slots_[read_]; }

 private:
  static constexpr std::uint32_t kFresh = 4;
  static constexpr std::uint32_t kIndexMask = 3;

  std::pmr::vector<T> slots_;
  alignas(64) std::uint32_t write_ = 0;
  alignas(64) std::uint32_t read_ = 1;
  alignas(64) std::atomic<std::uint32_t> middle_{2};
};

}  // namespace haustra
