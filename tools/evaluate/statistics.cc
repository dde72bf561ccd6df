#include "tools/evaluate/statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "hal/core/median.h"
#include "hal/core/percentile.h"

namespace haustra::evaluate {

double Median(std::vector<double> values) {
  HAUSTRA_CHECK(!values.empty());
  return MeanMedian(std::span<double>(values));
}

std::optional<Percentiles> FindPercentiles(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  const std::span<const double> sorted(values);
  return Percentiles{Percentile(sorted, 500), Percentile(sorted, 990), Percentile(sorted, 999), values.back()};
}

Spread FindSpread(const std::vector<double>& values) {
  HAUSTRA_CHECK(!values.empty());
  Spread spread;
  spread.count = values.size();
  spread.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  spread.min = *min;
  spread.max = *max;
  if (values.size() > 1) {
    double sum = 0.0;
    for (const double value : values) sum += (value - spread.mean) * (value - spread.mean);
    spread.deviation = std::sqrt(sum / static_cast<double>(values.size() - 1));
  }
  return spread;
}

}  // namespace haustra::evaluate
