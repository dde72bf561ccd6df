// The lumen that a scope passed through: its centre line and radius, from the scope's path and points of the wall.
// reentrant. Allocates; not rt-safe.
#pragma once

#include <Eigen/Core>
#include <span>

#include "engine/coverage/lumen_line.h"
#include "hal/core/status.h"

namespace haustra {

struct Lumen {
  LumenLine line;                // through the passed part and beyond its ends, where the wall goes on
  double radius_mu = 0.0;        // median over the stations of the circle in the wall
  double passed_begin_mu = 0.0;  // between these lengths the scope was
  double passed_end_mu = 0.0;
  double wall_share = 0.0;  // of the directions around the line, how many have a wall; mean along the passed part
};

// Less wall than this around the line is no lumen. A flat wall fills less than a half, however near.
inline constexpr double kMinWallShare = 0.55;
// A scope that went along the line by less than this, radii, has not shown where a lumen leads.
inline constexpr double kMinPassedRadii = 1.0;

// path: positions of the scope in order of time, map. wall: points of the wall, map.
// The path is made one curve (path_curve.h), and each station of it moved to the middle of the wall around it by a
// circle that is fitted robustly to one distance a direction, again and again. That begins with several radii: a scope
// may slide along the wall, far off the middle. The one whose circles have most wall on them is taken. What is not
// finite is passed over. kNotFound: there is no lumen; the message says why, for people.
Result<Lumen> FindLumen(std::span<const Eigen::Vector3d> path, std::span<const Eigen::Vector3d> wall);

}  // namespace haustra
