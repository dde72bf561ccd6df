#include "engine/surface/depth_jumps.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace haustra {
namespace {

constexpr std::array<std::array<int, 2>, 8> kAround{
    {{1, 0}, {0, 1}, {1, 1}, {-1, 1}, {-1, 0}, {0, -1}, {-1, -1}, {1, -1}}};

class JumpFinder {
 public:
  JumpFinder(const CameraModel& camera, int step_px, const JumpOptions& options, const DepthMap& map)
      : width_(map.width()),
        height_(map.height()),
        cotangent_(1.0 / std::tan(options.min_slant_deg * std::numbers::pi / 180.0)),
        max_ratio_(1.0 + options.one_wall),
        points_(map.num_cells(), Eigen::Vector3d::Zero()) {
    for (int i = 0; i < map.num_cells(); ++i) {
      Eigen::Vector3d bearing;
      if (map.has_depth(i) &&
          camera.Unproject({CellCentrePx(i % width_, step_px), CellCentrePx(i / width_, step_px)}, &bearing)) {
        points_[i] = map.range_mu(i) * bearing;
      }
    }
  }

  struct Around {
    int known = 0;
    int jumps = 0;
  };
  Around LookAround(int cell) const {
    Around around;
    if (points_[cell].isZero()) return around;
    for (const auto& [u, v] : kAround) {
      const int x = cell % width_ + u, y = cell / width_ + v;
      if (x < 0 || y < 0 || x >= width_ || y >= height_) continue;
      const Eigen::Vector3d& other = points_[y * width_ + x];
      if (other.isZero()) continue;
      ++around.known;
      around.jumps += IsJump(points_[cell], other) ? 1 : 0;
    }
    return around;
  }
  void Forget(int cell) { points_[cell].setZero(); }

 private:
  bool IsJump(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const {
    // By the sine rule: far / near = sin(slant + angle) / sin(slant).
    const double range_a = a.norm(), range_b = b.norm(), product = range_a * range_b;
    const double cosine = a.dot(b) / product, sine = a.cross(b).norm() / product;
    return std::max(range_a, range_b) / std::min(range_a, range_b) > std::max(max_ratio_, cosine + cotangent_ * sine);
  }

  int width_, height_;
  double cotangent_, max_ratio_;
  std::vector<Eigen::Vector3d> points_;  // zero: none
};

}  // namespace

int EraseJumps(const CameraModel& camera, int step_px, const JumpOptions& options, DepthMap* map) {
  JumpFinder finder(camera, step_px, options, *map);
  int count = 0;
  // All are found before the first is forgotten: the order of the cells must not matter.
  const auto erase_where = [&](const auto& is_erased) {
    std::vector<int> erased;
    for (int cell = 0; cell < map->num_cells(); ++cell) {
      if (is_erased(finder.LookAround(cell))) erased.push_back(cell);
    }
    for (const int cell : erased) {
      map->Erase(cell);
      finder.Forget(cell);
    }
    count += static_cast<int>(erased.size());
  };
  erase_where([](const JumpFinder::Around& around) { return 2 * around.jumps > around.known; });
  erase_where([](const JumpFinder::Around& around) { return around.jumps > 0; });
  return count;
}

}  // namespace haustra
