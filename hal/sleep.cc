#include "hal/sleep.h"

#include <thread>

namespace haustra {

void SleepFor(Duration duration) { std::this_thread::sleep_for(duration); }

}  // namespace haustra
