// Where time comes from. The system clock lives in platform/, a manual one in hal/fakes/.
#pragma once

#include "hal/core/time.h"

namespace haustra {

class Clock {
 public:
  virtual ~Clock() = default;
  // thread-safe, rt-safe.
  virtual TimePoint Now() const = 0;
};

}  // namespace haustra
