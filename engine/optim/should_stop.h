// When an optimiser stops before it is done. Private to engine/optim.
#pragma once

#include <functional>

#include "hal/clock.h"
#include "hal/core/time.h"

namespace haustra::optim {

// Whether the caller wants it or `deadline` has come; `clock` is needed only with a deadline.
inline bool ShouldStop(const std::function<bool()>& should_stop, TimePoint deadline, const Clock* clock) {
  if (should_stop && should_stop()) return true;
  return deadline != kNoDeadline && clock->Now() >= deadline;
}

}  // namespace haustra::optim
