// Carries a task from the thread that has a question to the one that works on it, and its answer back: one task at a
// time, which belongs to the first, then to the second, then to the first again. Neither waits for the other. Two
// threads, or one for both; wait-free. The task's memory is taken at construction.
#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

namespace haustra {

template <typename Task>
class TaskMailbox {
 public:
  template <typename... Args>
  explicit TaskMailbox(Args&&... args) : task_(std::forward<Args>(args)...) {}
  TaskMailbox(const TaskMailbox&) = delete;
  TaskMailbox& operator=(const TaskMailbox&) = delete;

  // Who asks. The task to fill; null while one is out.
  Task* Free() { return StateIs(kFree) ? &task_ : nullptr; }
  void Ask() {
    ++num_asked_;
    state_.store(kAsked, std::memory_order_release);
  }
  // The next stage of a task whose answer was heard.
  void AskOn() { state_.store(kAsked, std::memory_order_release); }
  // Null: no answer yet.
  Task* Answered() { return StateIs(kAnswered) ? &task_ : nullptr; }
  void Take() {
    ++num_taken_;
    state_.store(kFree, std::memory_order_release);
  }
  // What the n-th task names is not read any more when so many were taken.
  std::uint64_t num_asked() const { return num_asked_; }
  std::uint64_t num_taken() const { return num_taken_; }

  // Who answers. Null: nothing to do.
  Task* Asked() { return StateIs(kAsked) ? &task_ : nullptr; }
  void Answer() { state_.store(kAnswered, std::memory_order_release); }

  // Any thread.
  bool has_question() const { return StateIs(kAsked); }
  bool is_out() const { return !StateIs(kFree); }

 private:
  enum State : std::uint8_t { kFree, kAsked, kAnswered };
  bool StateIs(State state) const { return state_.load(std::memory_order_acquire) == state; }

  Task task_;
  std::atomic<State> state_{kFree};
  std::uint64_t num_asked_ = 0;
  std::uint64_t num_taken_ = 0;
};

}  // namespace haustra
