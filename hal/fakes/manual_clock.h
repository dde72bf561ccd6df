// A clock that stands still until it is told to move, and never goes back. thread-safe, rt-safe.
#pragma once

#include <atomic>
#include <cstdint>

#include "hal/clock.h"

namespace haustra {

class ManualClock final : public Clock {
 public:
  explicit ManualClock(TimePoint start = TimePoint{}) : now_ns_(start.time_since_epoch().count()) {}

  TimePoint Now() const override { return TimePoint(Duration(now_ns_.load(std::memory_order_acquire))); }

  void Advance(Duration by) {
    if (by.count() > 0) now_ns_.fetch_add(by.count(), std::memory_order_acq_rel);
  }
  // Earlier times leave the clock as it is.
  void AdvanceTo(TimePoint time) {
    const std::int64_t target = time.time_since_epoch().count();
    std::int64_t now = now_ns_.load(std::memory_order_relaxed);
    while (now < target && !now_ns_.compare_exchange_weak(now, target, std::memory_order_acq_rel)) {
    }
  }

 private:
  std::atomic<std::int64_t> now_ns_;
};

}  // namespace haustra
