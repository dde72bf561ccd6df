#include "engine/surface/depth_consistency.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "hal/core/check.h"

namespace haustra {
namespace {

// The cell whose centre is nearest to the pixel; -1: outside.
int NearestCell(const DepthMap& map, int step_px, const Eigen::Vector2d& pixel) {
  const double offset = CellCentrePx(0, step_px);
  const double x = std::round((pixel.x() - offset) / step_px), y = std::round((pixel.y() - offset) / step_px);
  if (!(x >= 0.0 && y >= 0.0 && x < map.width() && y < map.height())) return -1;
  return static_cast<int>(y) * map.width() + static_cast<int>(x);
}

}  // namespace

int CheckDepth(const CameraModel& camera, int step_px, const PosedDepth& reference, std::span<const PosedDepth> others,
               const ConsistencyOptions& options, DepthMap* checked) {
  const DepthMap& own = *reference.depth;
  HAUSTRA_CHECK(checked != reference.depth && checked->width() == own.width() && checked->height() == own.height());
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < own.num_cells(); ++i) {
    if (own.has_depth(i)) nearest = std::min(nearest, own.range_mu(i));
  }
  checked->Clear(std::isfinite(nearest) ? nearest / (1.0 + 2.0 * options.tolerance) : 1.0);
  const SE3 map_from_reference = reference.cam_from_map.Inverse();
  int count = 0;
  for (int i = 0; i < own.num_cells(); ++i) {
    if (!own.has_depth(i) || own.confidence(i) < options.min_confidence) continue;
    const int x = i % own.width(), y = i / own.width();
    Eigen::Vector3d bearing;
    if (!camera.Unproject({CellCentrePx(x, step_px), CellCentrePx(y, step_px)}, &bearing)) continue;
    const double range = own.range_mu(i);
    const Eigen::Vector3d point_in_map = map_from_reference * Eigen::Vector3d(range * bearing);
    int agreeing = 0;
    double sum = own.confidence(i) * own.inverse_range(i), weight = own.confidence(i);
    for (const PosedDepth& other : others) {
      const Eigen::Vector3d point_in_other = other.cam_from_map * point_in_map;
      Eigen::Vector2d pixel;
      if (!camera.Project(point_in_other, &pixel)) continue;
      const int cell = NearestCell(*other.depth, step_px, pixel);
      if (cell < 0 || !other.depth->has_depth(cell) || other.depth->confidence(cell) < options.min_confidence) continue;
      const double expected = point_in_other.norm(), seen = other.depth->range_mu(cell);
      if (std::abs(seen - expected) > options.tolerance * expected) continue;
      ++agreeing;
      // What the other one saw, as a range of this one: the point moves along the other's ray.
      const Eigen::Vector3d moved_in_other = point_in_other * (seen / expected);
      const Eigen::Vector3d moved = reference.cam_from_map * (other.cam_from_map.Inverse() * moved_in_other);
      const double moved_range = moved.dot(bearing);
      if (!(moved_range > 0.5 * range)) continue;
      sum += other.depth->confidence(cell) / moved_range;
      weight += other.depth->confidence(cell);
    }
    if (agreeing < options.min_agreeing) continue;
    checked->Set(i, sum / weight, own.confidence(i));
    count += checked->has_depth(i) ? 1 : 0;
  }
  return count;
}

}  // namespace haustra
