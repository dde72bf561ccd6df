// A sign of life of the tracking thread: beats for every frame and, while no frame comes, many times a second. It does
// not beat while the thread waits for the vision device. Who watches it (the daemon's watchdog) knows that no beat for
// a second means a hang, whatever the camera does. One thread beats, any number read; rt-safe, wait-free.
#pragma once

#include <atomic>
#include <cstdint>

#include "hal/core/time.h"

namespace haustra {

class Heartbeat {
 public:
  void Beat(TimePoint now) {
    last_ns_.store(now.time_since_epoch().count(), std::memory_order_relaxed);
    count_.fetch_add(1, std::memory_order_release);
  }

  std::uint64_t count() const { return count_.load(std::memory_order_acquire); }
  // Of the session's clock; zero before the first beat.
  TimePoint last() const { return TimePoint(Duration(last_ns_.load(std::memory_order_relaxed))); }

 private:
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::int64_t> last_ns_{0};
};

}  // namespace haustra
