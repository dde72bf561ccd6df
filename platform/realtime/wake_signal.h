// One thread wakes another: a POSIX semaphore with a time limit on CLOCK_MONOTONIC. (The timed wait of
// std::counting_semaphore in libstdc++ 12 polls with sleeps of half the time waited so far: many milliseconds late.)
// Post never waits; thread-safe, rt-safe.
#pragma once

#include <semaphore.h>

#include <ctime>

#include "hal/core/check.h"
#include "hal/core/time.h"

namespace haustra {

class WakeSignal {
 public:
  WakeSignal() { HAUSTRA_CHECK(sem_init(&semaphore_, 0, 0) == 0); }
  ~WakeSignal() { sem_destroy(&semaphore_); }
  WakeSignal(const WakeSignal&) = delete;
  WakeSignal& operator=(const WakeSignal&) = delete;

  void Post() { sem_post(&semaphore_); }

  // True when it was posted; each post wakes once. An interrupted wait ends early, as if the time were over.
  bool WaitFor(Duration limit) {
    timespec until{};
    clock_gettime(CLOCK_MONOTONIC, &until);
    const std::int64_t ns = until.tv_nsec + limit.count();
    until.tv_sec += ns / 1'000'000'000;
    until.tv_nsec = ns % 1'000'000'000;
    return sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &until) == 0;
  }

 private:
  sem_t semaphore_;
};

}  // namespace haustra
