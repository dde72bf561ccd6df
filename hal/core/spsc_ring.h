// Single-producer single-consumer ring of at most `capacity` elements; wait-free, memory taken at construction.
// Full: TryPush returns false, BeginPush returns nullptr, and both count it (policy of the ring: drop newest).
// Elements that own memory are filled in place (BeginPush, CommitPush) and read in place (Front, Pop): a slot keeps
// what its last user left, so nothing is allocated after construction.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <utility>
#include <vector>

#include "hal/core/memory_arena.h"

namespace haustra {

template <typename T>
class SpscRing {
 public:
  explicit SpscRing(std::size_t capacity) : slots_(capacity + 1) {}
  SpscRing(std::size_t capacity, const T& prototype) : slots_(capacity + 1, prototype) {}
  // Every element is made from `args`; elements that own memory take it from `memory` when they are told so there.
  template <typename... Args>
  SpscRing(std::size_t capacity, std::pmr::memory_resource* memory, const Args&... args) : slots_(memory) {
    slots_.reserve(capacity + 1);
    for (std::size_t i = 0; i <= capacity; ++i) slots_.emplace_back(args...);
  }

  // Elements that exist in memory: one more than the capacity.
  static constexpr std::size_t NumSlots(std::size_t capacity) { return capacity + 1; }
  // What a ring takes from its arena, without memory that its elements own.
  static constexpr std::size_t BytesFor(std::size_t capacity) { return MemoryArena::BytesFor<T>(NumSlots(capacity)); }

  // Producer. The slot to fill, or nullptr when the ring is full. Nothing is visible before CommitPush.
  T* BeginPush() {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (Next(head) == tail_.load(std::memory_order_acquire)) {
      num_dropped_.fetch_add(1, std::memory_order_relaxed);
      return nullptr;
    }
    return &slots_[head];
  }
  void CommitPush() { head_.store(Next(head_.load(std::memory_order_relaxed)), std::memory_order_release); }

  // Consumer. The oldest element, or nullptr when the ring is empty; it stays until Pop.
  T* Front() { return is_empty() ? nullptr : &slots_[tail_.load(std::memory_order_relaxed)]; }
  void Pop() { tail_.store(Next(tail_.load(std::memory_order_relaxed)), std::memory_order_release); }

  bool TryPush(T value) {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    const std::size_t next = Next(head);
    if (next == tail_.load(std::memory_order_acquire)) {
      num_dropped_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    slots_[head] = std::move(value);
    head_.store(next, std::memory_order_release);
    return true;
  }

  bool TryPop(T* value) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail == head_.load(std::memory_order_acquire)) return false;
    *value = std::move(slots_[tail]);
    tail_.store(Next(tail), std::memory_order_release);
    return true;
  }

  // Exact for the two threads that own the ends, a hint for others.
  bool is_empty() const { return tail_.load(std::memory_order_acquire) == head_.load(std::memory_order_acquire); }
  std::size_t size() const {
    const std::size_t head = head_.load(std::memory_order_acquire);
    const std::size_t tail = tail_.load(std::memory_order_acquire);
    return head >= tail ? head - tail : head + slots_.size() - tail;
  }
  std::size_t capacity() const { return slots_.size() - 1; }
  std::uint64_t num_dropped() const { return num_dropped_.load(std::memory_order_relaxed); }

 private:
  std::size_t Next(std::size_t i) const { return i + 1 == slots_.size() ? 0 : i + 1; }

  std::pmr::vector<T> slots_;
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::atomic<std::uint64_t> num_dropped_{0};
};

}  // namespace haustra
