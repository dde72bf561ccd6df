#include "engine/surface/depth_consistency.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

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

// What other keyframes say of a point that one claims.
struct Support {
  int agreeing = 0;
  int seeing_through = 0;
  // Inverse ranges in the claiming keyframe by those that agree, each times its confidence.
  double sum = 0.0;
  double weight = 0.0;
};

// Depths that points on rays of another keyframe are held against.
class OtherDepths {
 public:
  OtherDepths(const CameraModel& camera, int step_px, const SE3& cam_from_map, std::span<const PosedDepth> others,
              const ConsistencyOptions& options)
      : camera_(camera),
        step_px_(step_px),
        cam_from_map_(cam_from_map),
        map_from_cam_(cam_from_map.Inverse()),
        others_(others),
        options_(options) {}

  // False: the camera model has no ray there.
  bool BearingOf(int width, int cell, Eigen::Vector3d* bearing) const {
    return camera_.Unproject({CellCentrePx(cell % width, step_px_), CellCentrePx(cell / width, step_px_)}, bearing);
  }

  Support SupportOf(const Eigen::Vector3d& bearing, double range) const {
    const Eigen::Vector3d point_in_map = map_from_cam_ * Eigen::Vector3d(range * bearing);
    Support support;
    for (const PosedDepth& other : others_) {
      const Eigen::Vector3d point_in_other = other.cam_from_map * point_in_map;
      Eigen::Vector2d pixel;
      if (!camera_.Project(point_in_other, &pixel)) continue;
      const int cell = NearestCell(*other.depth, step_px_, pixel);
      if (cell < 0 || !IsKnown(*other.depth, cell)) continue;
      const double expected = point_in_other.norm(), seen = other.depth->range_mu(cell);
      if (seen > (1.0 + options_.seen_through) * expected) ++support.seeing_through;
      if (std::abs(seen - expected) > options_.tolerance * expected) continue;
      ++support.agreeing;
      // What the other one saw, as a range of this one: the point moves along the other's ray.
      const Eigen::Vector3d moved_in_other = point_in_other * (seen / expected);
      const Eigen::Vector3d moved = cam_from_map_ * (other.cam_from_map.Inverse() * moved_in_other);
      const double moved_range = moved.dot(bearing);
      if (!(moved_range > 0.5 * range)) continue;
      support.sum += other.depth->confidence(cell) / moved_range;
      support.weight += other.depth->confidence(cell);
    }
    return support;
  }

  bool IsKnown(const DepthMap& depth, int cell) const {
    return depth.has_depth(cell) && depth.confidence(cell) >= options_.min_confidence;
  }
  // num_claiming: keyframes that agree and are not among these.
  bool Stands(const Support& support, int num_claiming) const {
    return support.seeing_through <= options_.max_seeing_through * (support.agreeing + num_claiming);
  }

 private:
  const CameraModel& camera_;
  const int step_px_;
  const SE3& cam_from_map_;
  const SE3 map_from_cam_;
  const std::span<const PosedDepth> others_;
  const ConsistencyOptions& options_;
};

double NearestRange(const DepthMap& depth) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < depth.num_cells(); ++i) {
    if (depth.has_depth(i)) nearest = std::min(nearest, depth.range_mu(i));
  }
  return nearest;
}

// A range that another keyframe's wall has in a cell of this one.
struct CarriedRange {
  int cell = 0;
  double range_mu = 0.0;
  int confidence = 0;
};

// By cell, then from near to far.
std::vector<CarriedRange> CarryRanges(const CameraModel& camera, int step_px, const PosedDepth& reference,
                                      std::span<const PosedDepth> others, std::span<const std::uint8_t> shows_scene) {
  std::vector<CarriedRange> carried;
  for (const PosedDepth& other : others) {
    const SE3 reference_from_other = reference.cam_from_map * other.cam_from_map.Inverse();
    const int width = other.depth->width();
    for (int i = 0; i < other.depth->num_cells(); ++i) {
      Eigen::Vector3d bearing;
      if (!other.depth->has_depth(i) ||
          !camera.Unproject({CellCentrePx(i % width, step_px), CellCentrePx(i / width, step_px)}, &bearing)) {
        continue;
      }
      const Eigen::Vector3d point = reference_from_other * Eigen::Vector3d(other.depth->range_mu(i) * bearing);
      Eigen::Vector2d pixel;
      if (!camera.Project(point, &pixel)) continue;
      const int cell = NearestCell(*reference.depth, step_px, pixel);
      if (cell < 0 || shows_scene[cell] == 0 || reference.depth->has_depth(cell)) continue;
      carried.push_back({cell, point.norm(), other.depth->confidence(i)});
    }
  }
  std::sort(carried.begin(), carried.end(), [](const CarriedRange& a, const CarriedRange& b) {
    if (a.cell != b.cell) return a.cell < b.cell;
    return a.range_mu != b.range_mu ? a.range_mu < b.range_mu : a.confidence < b.confidence;
  });
  return carried;
}

}  // namespace

int CheckDepth(const CameraModel& camera, int step_px, const PosedDepth& reference, std::span<const PosedDepth> others,
               const ConsistencyOptions& options, DepthMap* checked) {
  const DepthMap& own = *reference.depth;
  HAUSTRA_CHECK(checked != reference.depth && checked->width() == own.width() && checked->height() == own.height());
  const double nearest = NearestRange(own);
  checked->Clear(std::isfinite(nearest) ? nearest / (1.0 + 2.0 * options.tolerance) : 1.0);
  const OtherDepths other_depths(camera, step_px, reference.cam_from_map, others, options);
  const int min_agreeing = std::min(options.min_agreeing, std::max(1, static_cast<int>(others.size())));
  int count = 0;
  for (int i = 0; i < own.num_cells(); ++i) {
    Eigen::Vector3d bearing;
    if (!other_depths.IsKnown(own, i) || !other_depths.BearingOf(own.width(), i, &bearing)) continue;
    const Support support = other_depths.SupportOf(bearing, own.range_mu(i));
    if (support.agreeing < min_agreeing || !other_depths.Stands(support, 1)) continue;
    const double sum = support.sum + own.confidence(i) * own.inverse_range(i);
    checked->Set(i, sum / (support.weight + own.confidence(i)), own.confidence(i));
    count += checked->has_depth(i) ? 1 : 0;
  }
  return count;
}

int FillDepth(const CameraModel& camera, int step_px, const PosedDepth& reference, std::span<const PosedDepth> others,
              std::span<const std::uint8_t> shows_scene, const ConsistencyOptions& options, DepthMap* filled) {
  const DepthMap& own = *reference.depth;
  HAUSTRA_CHECK(filled != reference.depth && filled->width() == own.width() && filled->height() == own.height());
  HAUSTRA_CHECK(shows_scene.size() == static_cast<std::size_t>(own.num_cells()));
  const std::vector<CarriedRange> carried = CarryRanges(camera, step_px, reference, others, shows_scene);
  double nearest = NearestRange(own);
  for (const CarriedRange& each : carried) nearest = std::min(nearest, each.range_mu);
  filled->Clear(std::isfinite(nearest) ? nearest / (1.0 + 2.0 * options.tolerance) : 1.0);
  int count = 0;
  for (int i = 0; i < own.num_cells(); ++i) {
    if (own.has_depth(i)) filled->Set(i, own.inverse_range(i), own.confidence(i));
    count += filled->has_depth(i) ? 1 : 0;
  }
  const OtherDepths other_depths(camera, step_px, reference.cam_from_map, others, options);
  for (const CarriedRange& each : carried) {
    Eigen::Vector3d bearing;
    if (filled->has_depth(each.cell) || !other_depths.BearingOf(own.width(), each.cell, &bearing)) continue;
    const Support support = other_depths.SupportOf(bearing, each.range_mu);
    if (!(support.weight > 0.0) || !other_depths.Stands(support, 0)) continue;
    filled->Set(each.cell, support.sum / support.weight, each.confidence);
    count += filled->has_depth(each.cell) ? 1 : 0;
  }
  return count;
}

}  // namespace haustra
