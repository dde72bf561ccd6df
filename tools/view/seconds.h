// Times as the page of a running engine has them. reentrant.
#pragma once

#include <cmath>
#include <cstdint>

namespace haustra::view {

// To the millisecond.
inline double Seconds(std::int64_t ns) { return std::round(static_cast<double>(ns) * 1e-6) * 1e-3; }

}  // namespace haustra::view
