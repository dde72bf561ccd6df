// The clock of the machine: CLOCK_MONOTONIC, so that no change of the wall clock can move a deadline.
#pragma once

#include "hal/clock.h"

namespace haustra {

// thread-safe, rt-safe (vDSO call). The origin is the boot of the machine.
class SystemClock final : public Clock {
 public:
  TimePoint Now() const override;
};

}  // namespace haustra
