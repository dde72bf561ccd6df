// The path of a scope as one curve along the lumen: it goes back and forth, and the curve passes each place once.
// reentrant. Allocates what it returns, and a graph.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace haustra {

// positions: of the scope, in order of time, map. scale_mu: about the radius of the lumen, > 0. Positions in one cell
// of a fifth of it become one; neighbours are joined, and the curve is the longest of all shortest ways through them.
// A position that is not finite is passed over; how far away one lies does not matter. Where the scope jumped by more
// than four times the scale the curve does not go on: it is that of the part with most positions. Smoothed over half
// the scale. Empty when there are fewer than two places. O(places^2); places are at most one a cell.
std::vector<Eigen::Vector3d> CurveThroughPath(std::span<const Eigen::Vector3d> positions, double scale_mu);

// Each point by the mean of its neighbours along the curve, Gaussian, sigma in the curve's units; ends stay where they
// are. Points in about equal steps.
std::vector<Eigen::Vector3d> SmoothCurve(const std::vector<Eigen::Vector3d>& points, double sigma_mu);

}  // namespace haustra
