#include "kernels/cpu/lane_pool.h"

namespace haustra::kernels {

LanePool::LanePool(int num_threads) {
  threads_.reserve(num_threads > 1 ? num_threads - 1 : 0);
  for (int i = 1; i < num_threads; ++i) {
    threads_.emplace_back([this, i] { HelperLoop(i); });
  }
}

LanePool::~LanePool() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  work_available_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void LanePool::RunJob(Lane lane, int num_tasks, Trampoline run, const void* task) {
  Job& job = jobs_[static_cast<int>(lane)];
  std::unique_lock lock(mutex_);
  job.run = run;
  job.task = task;
  job.next = 0;
  job.num_tasks = num_tasks;
  job.num_running = 0;
  lock.unlock();
  work_available_.notify_all();
  lock.lock();
  while (job.next < job.num_tasks) {
    const int i = job.next++;
    lock.unlock();
    run(task, i, 0);
    lock.lock();
  }
  job.helpers_done.wait(lock, [&job] { return job.num_running == 0; });
  job.num_tasks = 0;
  job.next = 0;
}

LanePool::Job* LanePool::FindJob() {
  for (Job& job : jobs_) {  // in order of priority
    if (job.next < job.num_tasks) return &job;
  }
  return nullptr;
}

void LanePool::HelperLoop(int worker_idx) {
  std::unique_lock lock(mutex_);
  for (;;) {
    Job* job = nullptr;
    work_available_.wait(lock, [&] { return is_stopping_ || (job = FindJob()) != nullptr; });
    if (is_stopping_) return;
    const int i = job->next++;
    const Trampoline run = job->run;
    const void* task = job->task;
    ++job->num_running;
    lock.unlock();
    run(task, i, worker_idx);
    lock.lock();
    if (--job->num_running == 0 && job->next >= job->num_tasks) job->helpers_done.notify_one();
  }
}

}  // namespace haustra::kernels
