#include "tools/bench/timing.h"

#include <algorithm>
#include <cstdio>

namespace haustra {

Timing Summarise(std::vector<double>& times_us) {
  std::sort(times_us.begin(), times_us.end());
  const auto at = [&](double share) {
    return times_us[std::min(times_us.size() - 1,
                             static_cast<std::size_t>(share * static_cast<double>(times_us.size())))];
  };
  return {at(0.5), at(0.99), at(0.999), times_us.front()};
}

void PrintTiming(const char* what, const Timing& timing) {
  std::printf("%-58s median %8.1f  p99 %8.1f (%.2f)  p99.9 %8.1f  lowest %8.1f us\n", what, timing.median_us,
              timing.p99_us, timing.p99_us / timing.median_us, timing.p999_us, timing.lowest_us);
}

}  // namespace haustra
