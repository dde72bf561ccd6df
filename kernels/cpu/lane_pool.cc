#include "kernels/cpu/lane_pool.h"

#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <ctime>

#include "hal/core/check.h"

namespace haustra::kernels {
namespace {

timespec ToTimespec(TimePoint time) {
  const std::int64_t ns = std::max<std::int64_t>(time.time_since_epoch().count(), 0);
  return {static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
}

}  // namespace

bool IsOver(TimePoint deadline) {
  if (deadline == kNoDeadline) return false;
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return TimePoint(std::chrono::seconds(now.tv_sec) + Duration(now.tv_nsec)) >= deadline;
}

LanePool::LanePool(int num_threads) {
  HAUSTRA_CHECK(sem_init(&helpers_done_, 0, 0) == 0);
  try {
    threads_.reserve(static_cast<std::size_t>(std::max(num_threads - 1, 0)));
    for (int i = 1; i < num_threads; ++i) {
      threads_.emplace_back([this, i] { HelperLoop(i); });
    }
  } catch (...) {
    EndHelpers();
    throw;
  }
}

LanePool::~LanePool() { EndHelpers(); }

void LanePool::EndHelpers() {
  Close();
  is_stopping_.store(true);
  call_.fetch_add(1);
  call_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  sem_destroy(&helpers_done_);
}

bool LanePool::FollowThisThread() {
  int policy = 0;
  sched_param parameters{};
  if (pthread_getschedparam(pthread_self(), &policy, &parameters) != 0) return false;
  return std::all_of(threads_.begin(), threads_.end(), [&](std::thread& thread) {
    return pthread_setschedparam(thread.native_handle(), policy, &parameters) == 0;
  });
}

bool LanePool::Finish(TimePoint deadline) {
  const bool has_helpers = !threads_.empty() && rest_ > 1;
  if (has_helpers && !IsOver(deadline)) {
    Open();
    for (;;) {
      if (IsOver(deadline)) break;
      const int task = Take();
      if (task < 0) break;
      Run(task, 0);
    }
    Close();
  } else {
    for (; rest_ > 0 && !IsOver(deadline); --rest_) Run(num_tasks_ - rest_, 0);
  }
  return WaitForHelpers(deadline) && rest_ == 0;
}

bool LanePool::Drop(TimePoint deadline) {
  rest_ = 0;
  return WaitForHelpers(deadline);
}

void LanePool::Open() {
  left_.store(rest_, std::memory_order_release);
  call_.fetch_add(1);
  call_.notify_all();
}

void LanePool::Close() { rest_ = std::max(left_.exchange(0, std::memory_order_acq_rel), 0); }

int LanePool::Take() {
  const int left = left_.fetch_sub(1, std::memory_order_acq_rel);
  return left > 0 ? num_tasks_ - left : -1;
}

bool LanePool::WaitForHelpers(TimePoint deadline) {
  if (num_active_.load() == 0) return true;
  is_waiting_.store(true);
  const timespec until = ToTimespec(deadline);
  bool is_done = num_active_.load() == 0;
  for (bool is_over = false; !is_done && !is_over; is_done = num_active_.load() == 0) {
    const int error =
        deadline == kNoDeadline ? sem_wait(&helpers_done_) : sem_clockwait(&helpers_done_, CLOCK_MONOTONIC, &until);
    is_over = error != 0 && errno == ETIMEDOUT;
  }
  is_waiting_.store(false);
  return is_done;
}

void LanePool::HelperLoop(int worker_idx) {
  for (int seen = 0;;) {
    call_.wait(seen);
    seen = call_.load();
    if (is_stopping_.load()) return;
    // Counted before it takes a task: whoever closes the loop and then finds nobody active is alone.
    num_active_.fetch_add(1);
    for (int task = Take(); task >= 0; task = Take()) Run(task, worker_idx);
    if (num_active_.fetch_sub(1) == 1 && is_waiting_.load()) sem_post(&helpers_done_);
  }
}

}  // namespace haustra::kernels
