// Numbers that several estimators share.
#pragma once

#include <numbers>

namespace haustra {

inline constexpr double kDegree = std::numbers::pi / 180.0;  // in radians
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;
// What 95 % of true pixels stay below, as squared distance over variance: chi-squared, two degrees of freedom.
inline constexpr double kChi2TwoDof = 5.991;
// The same for one degree of freedom, as sigmas.
inline constexpr double kGateOneDof = 1.96;

}  // namespace haustra
