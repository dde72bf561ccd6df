// Carries a task to the recogniser and its answer back: one task at a time, which belongs to the mapper, then to the
// recogniser, then to the mapper again. Neither waits for the other. One mapping and one merging thread (or one for
// both, in sequential mode); wait-free.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory_resource>

#include "engine/place/place_task.h"

namespace haustra {

class PlaceMailbox {
 public:
  PlaceMailbox(const EngineConfig& config, std::pmr::memory_resource* memory) : task_(config, memory) {}
  PlaceMailbox(const PlaceMailbox&) = delete;
  PlaceMailbox& operator=(const PlaceMailbox&) = delete;

  // Mapping thread. The task to fill; null while one is out.
  PlaceTask* Free() { return StateIs(kFree) ? &task_ : nullptr; }
  void Ask() {
    ++num_asked_;
    state_.store(kAsked, std::memory_order_release);
  }
  // The next stage of a task whose answer was heard.
  void AskOn() { state_.store(kAsked, std::memory_order_release); }
  // Null: no answer yet.
  PlaceTask* Answered() { return StateIs(kAnswered) ? &task_ : nullptr; }
  void Take() {
    ++num_taken_;
    state_.store(kFree, std::memory_order_release);
  }
  // What the n-th task names is not read any more when so many were taken.
  std::uint64_t num_asked() const { return num_asked_; }
  std::uint64_t num_taken() const { return num_taken_; }

  // Merging thread. Null: nothing to do.
  PlaceTask* Asked() { return StateIs(kAsked) ? &task_ : nullptr; }
  void Answer() { state_.store(kAnswered, std::memory_order_release); }

  // Any thread.
  bool has_question() const { return StateIs(kAsked); }
  bool is_out() const { return !StateIs(kFree); }

 private:
  enum State : std::uint8_t { kFree, kAsked, kAnswered };
  bool StateIs(State state) const { return state_.load(std::memory_order_acquire) == state; }

  PlaceTask task_;
  std::atomic<State> state_{kFree};
  std::uint64_t num_asked_ = 0;
  std::uint64_t num_taken_ = 0;
};

}  // namespace haustra
