// Time as signed 64-bit nanoseconds. Never floating point, never the wall clock: a TimePoint counts from an origin that
// its clock defines (CLOCK_MONOTONIC live, the sequence's own time in replay).
#pragma once

#include <chrono>
#include <cstdint>

namespace haustra {

using Duration = std::chrono::nanoseconds;

struct MonotonicOrigin {
  using rep = std::int64_t;
  using period = std::nano;
  using duration = Duration;
  static constexpr bool is_steady = true;
};
using TimePoint = std::chrono::time_point<MonotonicOrigin, Duration>;

inline constexpr TimePoint kNoDeadline = TimePoint::max();

// Of two stamps, whichever is the earlier: a clock may be set back between them.
inline Duration Apart(TimePoint a, TimePoint b) { return a < b ? b - a : a - b; }

inline double ToSeconds(Duration d) { return static_cast<double>(d.count()) * 1e-9; }
inline double ToMilliseconds(Duration d) { return static_cast<double>(d.count()) * 1e-6; }

}  // namespace haustra
