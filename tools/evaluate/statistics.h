// Order statistics and spread. reentrant.
#pragma once

#include <optional>
#include <vector>

#include "tools/evaluate/run_output.h"

namespace haustra::evaluate {

// Of at least one value; for an even number the mean of the middle two.
double Median(std::vector<double> values);

// Nearest rank: the smallest value that at least this share of all values does not exceed. Nothing for no values.
std::optional<Percentiles> FindPercentiles(std::vector<double> values);

struct Spread {
  double mean = 0.0;
  double deviation = 0.0;  // of the sample (n - 1); 0 for one value
  double min = 0.0;
  double max = 0.0;
  std::size_t count = 0;
};

// Of at least one value.
Spread FindSpread(const std::vector<double>& values);

}  // namespace haustra::evaluate
