// Repeated measurements of one duration.
#pragma once

#include <vector>

namespace haustra {

struct Timing {
  double median_us = 0.0;
  double p99_us = 0.0;
  double p999_us = 0.0;
  double lowest_us = 0.0;
};

// `times_us` must not be empty; it is sorted.
Timing Summarise(std::vector<double>& times_us);

// "median 12.3, p99 13.0 (1.06 of the median), p99.9 14.1, lowest 12.0 us"
void PrintTiming(const char* what, const Timing& timing);

}  // namespace haustra
