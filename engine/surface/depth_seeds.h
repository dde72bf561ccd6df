// A first guess of the wall from sparse points: a plane for every cell of a depth map. rt-safe: no allocation.
#pragma once

#include <Eigen/Core>
#include <span>

namespace haustra {

// A point that the keyframe sees.
struct DepthSeed {
  Eigen::Vector2d cell = Eigen::Vector2d::Zero();      // where on the grid of cells; cell centres at integers
  Eigen::Vector3d bearing = Eigen::Vector3d::UnitZ();  // unit, camera
  double inverse_range = 0.0;                          // 1 / map units, > 0
};

// A plane p . x = 1 in the camera's coordinates, x in map units. Along a unit ray b its inverse range is p . b, linear
// in b: a plane can be continued from one cell to the next as it is.
using InversePlane = Eigen::Vector3d;

// The plane through the seeds nearest to a cell, by least squares with weights that fall with their distance, twice
// reweighted (Cauchy) so that a wrong seed does not bend it. With little spread it leans to the mean range. O(seeds).
// `seeds` is not empty.
InversePlane PlaneFromSeeds(std::span<const DepthSeed> seeds, const Eigen::Vector2d& cell,
                            const Eigen::Vector3d& bearing);

}  // namespace haustra
