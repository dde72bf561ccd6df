#include "tools/surface/wall_patches.h"

#include <algorithm>
#include <cmath>

#include "engine/surface/depth_consistency.h"
#include "tools/command/parallel_for.h"

namespace haustra::surface {
namespace {

// Range of another keyframe along the ray to a point of its camera; 0: not known.
double SeenRange(const DepthMap& depth, const CameraModel& camera, int step_px, const Eigen::Vector3d& point_in_cam) {
  Eigen::Vector2d pixel;
  if (!camera.Project(point_in_cam, &pixel)) return 0.0;
  const double offset = CellCentrePx(0, step_px);
  const double x = std::round((pixel.x() - offset) / step_px), y = std::round((pixel.y() - offset) / step_px);
  if (!(x >= 0.0 && y >= 0.0 && x < depth.width() && y < depth.height())) return 0.0;
  const int cell = static_cast<int>(y) * depth.width() + static_cast<int>(x);
  return depth.has_depth(cell) ? depth.range_mu(cell) : 0.0;
}

double FarthestOf(const DepthMap& depth) {
  double farthest = 0.0;
  for (int i = 0; i < depth.num_cells(); ++i) {
    if (depth.has_depth(i)) farthest = std::max(farthest, depth.range_mu(i));
  }
  return farthest;
}

}  // namespace

std::vector<WallPatch> PatchesOf(const std::vector<KeyframeDepth>& depths, const CameraModel& camera, int step_px,
                                 int num_threads) {
  const double tolerance = ConsistencyOptions().tolerance;
  std::vector<double> farthest;
  for (const KeyframeDepth& each : depths) farthest.push_back(FarthestOf(each.depth));
  std::vector<std::vector<WallPatch>> by_keyframe(depths.size());
  ParallelFor(static_cast<int>(depths.size()), std::max(1, num_threads), [&](int own, int) {
    const DepthMap& depth = depths[own].depth;
    const SE3 map_from_cam = depths[own].keyframe->cam_from_map.Inverse();
    // Those that are too far away to see the same wall are not asked.
    std::vector<int> near;
    for (int other = 0; other < static_cast<int>(depths.size()); ++other) {
      const Eigen::Vector3d centre = depths[other].keyframe->cam_from_map.InverseTranslation();
      if ((centre - map_from_cam.translation).norm() <= farthest[own] + farthest[other]) near.push_back(other);
    }
    for (int i = 0; i < depth.num_cells(); ++i) {
      Eigen::Vector3d bearing;
      if (!depth.has_depth(i) ||
          !camera.Unproject({CellCentrePx(i % depth.width(), step_px), CellCentrePx(i / depth.width(), step_px)},
                            &bearing)) {
        continue;
      }
      const Eigen::Vector3d point_in_map = map_from_cam * Eigen::Vector3d(depth.range_mu(i) * bearing);
      int agreeing = 0, contradicting = 0;
      for (const int other : near) {
        const Eigen::Vector3d point_in_other = depths[other].keyframe->cam_from_map * point_in_map;
        const double seen = SeenRange(depths[other].depth, camera, step_px, point_in_other);
        if (seen <= 0.0) continue;
        const double beyond = seen / point_in_other.norm() - 1.0;
        agreeing += std::abs(beyond) < tolerance ? 1 : 0;
        contradicting += beyond > kSeenThrough ? 1 : 0;
      }
      if (contradicting > kMaxContradictions * agreeing) continue;
      const double side = depth.range_mu(i) * step_px / camera.focal_px();
      by_keyframe[own].push_back({point_in_map, side * side});
    }
  });
  std::vector<WallPatch> patches;
  for (const std::vector<WallPatch>& each : by_keyframe) patches.insert(patches.end(), each.begin(), each.end());
  return patches;
}

}  // namespace haustra::surface
