// A clock by which one millisecond goes by whenever somebody looks, so that a test chooses at which look a deadline
// comes.
#pragma once

#include <chrono>

#include "hal/clock.h"

namespace haustra::test {

class TickingClock final : public Clock {
 public:
  TimePoint Now() const override { return now_ += std::chrono::milliseconds(1); }
  // The deadline that comes at the look with this number, counted from 0.
  static TimePoint DeadlineAtLook(int look) { return TimePoint(std::chrono::milliseconds(look + 1)); }

 private:
  mutable TimePoint now_;
};

}  // namespace haustra::test
