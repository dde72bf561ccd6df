// When an optimiser stops before it is done. Private to engine/optim.
#pragma once

#include <atomic>

#include "hal/clock.h"
#include "hal/core/time.h"

namespace haustra::optim {

// Whether `cancel` is set or `deadline` has come; `clock` is needed only with a deadline.
inline bool ShouldStop(const std::atomic<bool>* cancel, TimePoint deadline, const Clock* clock) {
  if (cancel != nullptr && cancel->load(std::memory_order_relaxed)) return true;
  return deadline != kNoDeadline && clock->Now() >= deadline;
}

}  // namespace haustra::optim
