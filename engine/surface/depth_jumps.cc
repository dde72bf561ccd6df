#include "engine/surface/depth_jumps.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace haustra {

int EraseJumps(const CameraModel& camera, int step_px, double min_slant_deg, DepthMap* map) {
  const int width = map->width(), height = map->height();
  std::vector<Eigen::Vector3d> points(map->num_cells(), Eigen::Vector3d::Zero());  // zero: none
  for (int i = 0; i < map->num_cells(); ++i) {
    Eigen::Vector3d bearing;
    if (!map->has_depth(i) ||
        !camera.Unproject({CellCentrePx(i % width, step_px), CellCentrePx(i / width, step_px)}, &bearing)) {
      continue;
    }
    points[i] = map->range_mu(i) * bearing;
  }
  const double cotangent = 1.0 / std::tan(min_slant_deg * std::numbers::pi / 180.0);
  std::vector<bool> is_at_jump(points.size(), false);
  const auto compare = [&](int a, int b) {
    if (points[a].isZero() || points[b].isZero()) return;
    // By the sine rule: far / near = sin(slant + angle) / sin(slant).
    const double range_a = points[a].norm(), range_b = points[b].norm(), product = range_a * range_b;
    const double cosine = points[a].dot(points[b]) / product, sine = points[a].cross(points[b]).norm() / product;
    const double far_per_near = std::max(range_a, range_b) / std::min(range_a, range_b);
    if (far_per_near > cosine + cotangent * sine) is_at_jump[a] = is_at_jump[b] = true;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int cell = y * width + x;
      if (x + 1 < width) compare(cell, cell + 1);
      if (y + 1 == height) continue;
      compare(cell, cell + width);
      if (x + 1 < width) compare(cell, cell + width + 1);
      if (x > 0) compare(cell, cell + width - 1);
    }
  }
  int count = 0;
  for (int i = 0; i < map->num_cells(); ++i) {
    if (!is_at_jump[i]) continue;
    map->Erase(i);
    ++count;
  }
  return count;
}

}  // namespace haustra
