#include "tools/bench_command/timing.h"

#include <algorithm>
#include <span>

#include "hal/core/percentile.h"
#include "tools/command/console.h"

namespace haustra {

Timing Summarise(std::vector<double>& times_us) {
  std::sort(times_us.begin(), times_us.end());
  const std::span<const double> sorted(times_us);
  return {Percentile(sorted, 500), Percentile(sorted, 990), Percentile(sorted, 999), times_us.front()};
}

void PrintTiming(const char* what, const Timing& timing) {
  console::Print("%-58s median %8.1f  p99 %8.1f (%.2f)  p99.9 %8.1f  lowest %8.1f us\n", what, timing.median_us,
                 timing.p99_us, timing.p99_us / timing.median_us, timing.p999_us, timing.lowest_us);
}

}  // namespace haustra
