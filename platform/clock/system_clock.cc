#include "platform/clock/system_clock.h"

#include <ctime>

#include "hal/core/check.h"

namespace haustra {

TimePoint SystemClock::Now() const {
  timespec now;
  const int error = clock_gettime(CLOCK_MONOTONIC, &now);
  HAUSTRA_CHECK(error == 0);  // fails only for a clock that the kernel does not have
  return TimePoint(std::chrono::seconds(now.tv_sec) + Duration(now.tv_nsec));
}

}  // namespace haustra
