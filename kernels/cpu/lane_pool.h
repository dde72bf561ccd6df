// A fixed number of threads that help the callers of two lanes with loops of independent tasks. A caller works on its
// own loop until it is done, so no lane ever depends on a helper being free; helpers look for work of the tracking lane
// first, before every task.
//
// No allocation after construction. thread-safe: one caller a lane at a time, two lanes at once.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "hal/vision_device.h"

namespace haustra::kernels {

class LanePool {
 public:
  // num_threads counts the caller: 1 starts no thread.
  explicit LanePool(int num_threads);
  ~LanePool();
  LanePool(const LanePool&) = delete;
  LanePool& operator=(const LanePool&) = delete;

  // Number of threads that may run tasks of one lane: the caller and the helpers.
  int num_threads() const { return static_cast<int>(threads_.size()) + 1; }

  // Calls task(task_idx, worker_idx) for every task_idx in [0, num_tasks), and returns when all are done. No two tasks
  // of one lane run with the same worker_idx, in [0, num_threads()), at the same time.
  template <typename Task>
  void ParallelFor(Lane lane, int num_tasks, const Task& task) {
    if (threads_.empty() || num_tasks <= 1) {
      for (int i = 0; i < num_tasks; ++i) task(i, 0);
      return;
    }
    RunJob(
        lane, num_tasks, [](const void* t, int i, int worker) { (*static_cast<const Task*>(t))(i, worker); }, &task);
  }

 private:
  using Trampoline = void (*)(const void* task, int task_idx, int worker_idx);
  struct Job {
    Trampoline run = nullptr;
    const void* task = nullptr;
    int next = 0;
    int num_tasks = 0;
    int num_running = 0;  // by helpers
    std::condition_variable helpers_done;
  };

  void RunJob(Lane lane, int num_tasks, Trampoline run, const void* task);
  void HelperLoop(int worker_idx);
  Job* FindJob();

  std::mutex mutex_;  // guards all below; held for a few instructions only
  std::condition_variable work_available_;
  Job jobs_[static_cast<int>(Lane::kNumLanes)];
  bool is_stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace haustra::kernels
