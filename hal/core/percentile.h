// The one definition of a percentile in figures and reports: the smallest value that so many of all do not exceed
// (nearest rank). reentrant, no allocation.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace haustra {

// per_mille: 500 is the median, 999 is p99.9. In whole numbers, because 0.999 * 1000 in floating point is not 999.
// `sorted` ascends; 0 when it is empty.
template <typename T>
T Percentile(std::span<const T> sorted, std::size_t per_mille) {
  if (sorted.empty()) return T{};
  const std::size_t rank = (per_mille * sorted.size() + 999) / 1000;
  return sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1];
}

}  // namespace haustra
