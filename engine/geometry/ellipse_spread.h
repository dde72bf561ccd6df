// How much of the image a set of points covers. The initialisation of a map is accepted only with points all over the
// image (paper, section on map initialisation: it accepts 59 % and rejects 35 %). reentrant, rt-safe; O(points +
// height).
#pragma once

#include <Eigen/Core>
#include <span>

namespace haustra {

// Share in [0, 1] of the image's area that lies inside the covariance ellipse of the points. The ellipse has its centre
// at their mean and its half axes are two standard deviations along the principal directions: for points that fill an
// ellipse evenly it is that ellipse. What sticks out of the image does not count. Points that fill the whole image
// evenly give 0.93 (the ellipse pokes out a little and misses the corners), those that fill a centred part of half the
// width and half the height 0.26, and a Gaussian cloud of standard deviation s in both directions 4 pi s^2 / area while
// it fits. 0 for fewer than three points or points on one line.
double EllipseSpread(std::span<const Eigen::Vector2d> pixels, int width_px, int height_px);

}  // namespace haustra
