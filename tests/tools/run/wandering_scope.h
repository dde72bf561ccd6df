// The path of a scope in a rigid or breathing lumen, by construction, for periodic_motion.h. reentrant.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "engine/geometry/rng.h"
#include "tools/run/periodic_motion.h"

namespace haustra::test {

inline constexpr double kBreathS = 3.7;

struct Breath {
  double amplitude = 0.0;  // share of the depth
  double from_s = 0.0, to_s = 1e9;
  double period_s = kBreathS;
};

// Its velocity along the axis is a random walk that is drawn back to rest within a second: red noise of `speed` (RMS,
// depths a second), at 25 frames a second.
inline std::vector<MotionSample> Wander(std::uint64_t seed, double duration_s, double speed, const Breath& breath = {},
                                        double depth_mu = 1.0) {
  constexpr double kFramePeriodS = 0.04, kKept = 0.96, kDrawn = 0.28;  // kKept^2 + kDrawn^2 = 1
  const double unit = std::sqrt(3.0);                                  // half the width of a uniform spread of one
  Rng rng(seed);
  std::vector<MotionSample> samples;
  double velocity = 0.0, place = 0.0;
  for (int i = 0; i * kFramePeriodS < duration_s; ++i) {
    const double time_s = i * kFramePeriodS;
    velocity = kKept * velocity + kDrawn * speed * rng.Uniform(-unit, unit);
    place += velocity * kFramePeriodS;
    const bool breathes = time_s >= breath.from_s && time_s < breath.to_s;
    const double swell =
        breathes ? breath.amplitude * std::sin(2.0 * std::numbers::pi * time_s / breath.period_s) : 0.0;
    samples.push_back({time_s, {0.0, 0.0, depth_mu * (place + swell)}, Eigen::Vector3d::UnitZ(), depth_mu});
  }
  return samples;
}

}  // namespace haustra::test
