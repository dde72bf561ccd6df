// The two medians of values in any order. They differ where the number of values is even. reentrant, no allocation;
// the values are reordered. (Of figures in reports: percentile.h.)
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace haustra {

// One of the values: the upper of the middle two. 0 when there are none.
template <typename T>
T UpperMedian(std::span<T> values) {
  if (values.empty()) return T{};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The mean of the middle two. 0 when there are none.
template <typename T>
T MeanMedian(std::span<T> values) {
  const T upper = UpperMedian(values);
  if (values.empty() || values.size() % 2 == 1) return upper;
  const auto end_of_lower = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  return T{0.5} * (upper + *std::max_element(values.begin(), end_of_lower));
}

}  // namespace haustra
