// Loops of independent tasks, shared out between the thread that asks for them and a fixed number of helpers. Each lane
// of the device has a pool of its own, so that lanes never wait for one another. The caller works on its own loop, and
// no loop depends on a helper being free. A loop can be left at a deadline and gone on with later.
//
// No allocation and no lock after construction: the caller waits only for tasks that helpers have begun, and not beyond
// its deadline. thread-bound(the one caller of the lane).
#pragma once

#include <semaphore.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <thread>
#include <type_traits>
#include <vector>

#include "hal/core/time.h"

namespace haustra::kernels {

// On CLOCK_MONOTONIC. Without a deadline no clock is read.
bool IsOver(TimePoint deadline);

class LanePool {
 public:
  // num_threads counts the caller: 1 starts no thread. Throws std::system_error where the system gives too few, and
  // leaves none behind.
  explicit LanePool(int num_threads);
  ~LanePool();
  LanePool(const LanePool&) = delete;
  LanePool& operator=(const LanePool&) = delete;

  // Number of threads that may run tasks: the caller and the helpers.
  int num_threads() const { return static_cast<int>(threads_.size()) + 1; }

  // The helpers take on policy and priority of the calling thread; their processors stay as they are. False: the system
  // refuses. Not rt-safe.
  bool FollowThisThread();

  // A loop of task(task_idx, worker_idx) over every task_idx in [0, num_tasks). No two tasks run with the same
  // worker_idx, in [0, num_threads()), at the same time. `task` is copied and may outlive the caller's variables: it
  // captures values. The loop before has been finished or dropped.
  template <typename Task>
  void Begin(int num_tasks, const Task& task) {
    static_assert(sizeof(Task) <= kMaxTaskBytes && std::is_trivially_copyable_v<Task>);
    std::memcpy(task_.data(), &task, sizeof(Task));
    run_ = [](const void* t, int i, int worker) { (*static_cast<const Task*>(t))(i, worker); };
    num_tasks_ = rest_ = num_tasks;
  }

  // Works on the loop until it is done: true. False when the deadline is over before; the loop can be gone on with. At
  // least as late as the deadline by what a task takes.
  bool Finish(TimePoint deadline);

  // Gives the rest of the loop up, and waits until no helper is in a task: true. False when the deadline is over
  // before.
  bool Drop(TimePoint deadline);

 private:
  static constexpr std::size_t kMaxTaskBytes = 64;

  void EndHelpers();
  // Hands what is left to the helpers.
  void Open();
  // Takes it back.
  void Close();
  bool WaitForHelpers(TimePoint deadline);
  void HelperLoop(int worker_idx);
  // The index of the next task, or -1.
  int Take();
  void Run(int task_idx, int worker_idx) { run_(task_.data(), task_idx, worker_idx); }

  // The loop; written while left_ is not above zero and no helper is active, read by those who took a task.
  void (*run_)(const void* task, int task_idx, int worker_idx) = nullptr;
  alignas(std::max_align_t) std::array<std::byte, kMaxTaskBytes> task_;
  int num_tasks_ = 0;

  int rest_ = 0;                         // tasks that nobody has taken, while the loop is closed; the caller's
  std::atomic<int> left_{0};             // the same while it is open; above zero: whoever takes one has a task
  std::atomic<int> num_active_{0};       // helpers that may be in a task
  std::atomic<int> call_{0};             // changes when there is work
  std::atomic<bool> is_waiting_{false};  // the caller, for the last helper
  std::atomic<bool> is_stopping_{false};
  sem_t helpers_done_;
  std::vector<std::thread> threads_;
};

}  // namespace haustra::kernels
