// A time as people read it in messages and logs. reentrant.
#pragma once

#include <cstdio>
#include <string>

#include "hal/core/time.h"

namespace haustra {

// "1000.220": to the millisecond, from the origin of its clock.
inline std::string SecondsText(TimePoint time) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f", ToSeconds(time.time_since_epoch()));
  return text;
}

}  // namespace haustra
