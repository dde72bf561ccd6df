// Gives up the processor for a while; for work in the background that has to keep out of somebody's way. Never on the
// tracking thread. thread-safe.
#pragma once

#include "hal/core/time.h"

namespace haustra {

void SleepFor(Duration duration);

}  // namespace haustra
