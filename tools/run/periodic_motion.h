// Periodic motion between scope and wall, in the path of a camera through one map: what a breath leaves there. A map
// cannot tell a wall that breathes from a scope that steps to and fro: either is found, and which it was is not known.
// Only motion along the optical axis is looked at, that is how a lumen that widens shows. reentrant.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace haustra {

// Breaths of 8 to 40 a minute.
inline constexpr double kShortestPeriodS = 1.5;
inline constexpr double kLongestPeriodS = 8.0;
// Smaller motions are not reported: a hand that trembles makes them, too. Share of the scene depth.
inline constexpr double kMinPeriodicAmplitude = 0.02;
// How likely it may be that motion without a period looks like what is reported.
inline constexpr double kMaxChance = 0.01;

// Where the camera was at one time.
struct MotionSample {
  double time_s = 0.0;
  Eigen::Vector3d centre_mu = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  // optical axis, unit, in the map
  double depth_mu = 0.0;                            // of the scene, > 0
};

// A part of the path in which scope and wall move to and fro.
struct PeriodicStretch {
  double from_s = 0.0, to_s = 0.0;  // as the samples have times
  double period_s = 0.0;
  double amplitude = 0.0;  // from the middle to one end, share of the scene depth
  double chance = 0.0;     // that motion without a period does the same anywhere in the path, [0, kMaxChance]
};

struct PeriodicMotion {
  double longest_period_s = 0.0;           // that the path is long enough for; 0: it is too short for any
  std::vector<PeriodicStretch> stretches;  // in order of time; they overlap only where their periods differ
};

// `samples`: in order of time. Between two that are more than half a second apart the motion is not known.
// The velocity along the axis, over the depth, is fitted window by window with a sinusoid and a line of slow travel:
// the least squares of Lomb (1976) and Scargle (1982) with a floating mean, in overlapping Hann windows of one and a
// half periods. A motion with a period has the same phase in all windows, a hand has not: the test is the coherence of
// the windows (as in the F-test of a line by Thomson 1982, with windows in time for tapers). The noise is that of the
// same windows at the same frequency, so that red noise does not pass for a line. At least four and a half periods are
// needed.
PeriodicMotion FindPeriodicMotion(std::span<const MotionSample> samples);

}  // namespace haustra
