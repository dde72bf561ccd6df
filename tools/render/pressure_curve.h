// Air in the colon: it is lost slowly, the lumen becomes narrow, and it is insufflated again. Time in s. reentrant.
#pragma once

#include <algorithm>
#include <cmath>

namespace haustra::render {

struct PressureCurve {
  // Beyond it the scope would touch the folds.
  static constexpr double kMaxCollapse = 0.4;
  static constexpr double kMinPeriodS = 2.0;

  double collapse = 0.0;   // share of the radius that is lost at the lowest pressure, [0, kMaxCollapse]
  double period_s = 12.0;  // from one insufflation to the next, [kMinPeriodS, 3600]

  // Factor on the wall's radius: 1 at time 0 and at each full period, 1 - collapse at the lowest pressure.
  double RadiusGain(double time_s) const {
    if (collapse == 0.0) return 1.0;
    const double phase = time_s / period_s - std::floor(time_s / period_s);
    return 1.0 - collapse * (Ease(phase / kLeakEnd) - Ease((phase - kInsufflateFrom) / (1.0 - kInsufflateFrom)));
  }

 private:
  static constexpr double kLeakEnd = 0.6, kInsufflateFrom = 0.7;  // shares of the period
  // From 0 to 1, without a kink.
  static double Ease(double x) {
    const double t = std::clamp(x, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
  }
};

}  // namespace haustra::render
