#include "engine/geometry/ellipse_spread.h"

#include <algorithm>
#include <cmath>

namespace haustra {
namespace {

constexpr double kHalfAxisSigmas = 2.0;
// Correlation so close to one that the points lie on a line.
constexpr double kMinRelativeDeterminant = 1e-9;

}  // namespace

double EllipseSpread(std::span<const Eigen::Vector2d> pixels, int width_px, int height_px) {
  if (pixels.size() < 3 || width_px <= 0 || height_px <= 0) return 0.0;
  const double count = static_cast<double>(pixels.size());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& pixel : pixels) mean += pixel;
  mean /= count;
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (const Eigen::Vector2d& pixel : pixels) {
    const Eigen::Vector2d d = pixel - mean;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  xx /= count;
  xy /= count;
  yy /= count;
  const double determinant = xx * yy - xy * xy;
  if (!(determinant > kMinRelativeDeterminant * xx * yy) || !(xx * yy > 0.0)) return 0.0;

  // Row by row (rows of height one around the pixel centres): on row y the ellipse spans a segment centred on the
  // regression line x = mean + xy / yy * dy, of half length k * sqrt(determinant / yy * (1 - dy^2 / (k^2 yy))).
  const double left = -0.5, right = width_px - 0.5;
  double area = 0.0;
  for (int row = 0; row < height_px; ++row) {
    const double dy = row - mean.y();
    const double inside = 1.0 - dy * dy / (kHalfAxisSigmas * kHalfAxisSigmas * yy);
    if (inside <= 0.0) continue;
    const double middle = mean.x() + xy / yy * dy;
    const double half = kHalfAxisSigmas * std::sqrt(determinant / yy * inside);
    area += std::max(0.0, std::min(middle + half, right) - std::max(middle - half, left));
  }
  return area / (static_cast<double>(width_px) * height_px);
}

}  // namespace haustra
