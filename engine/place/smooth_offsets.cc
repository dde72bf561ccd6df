#include "engine/place/smooth_offsets.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace haustra {
namespace {

struct NearMatch {
  std::size_t match = 0;
  Eigen::Vector2d pixel;   // in the view of a
  Eigen::Vector2d offset;  // there
};

bool OffsetIn(const CameraModel& camera, const SE3& cam_from_map, const Eigen::Vector3d& point,
              const Eigen::Vector2d& pixel, double max_px, Eigen::Vector2d* offset) {
  Eigen::Vector2d projected;
  if (!camera.Project(cam_from_map * point, &projected)) return false;
  *offset = projected - pixel;
  return offset->norm() <= max_px;
}

double Median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// Of each coordinate by itself.
Eigen::Vector2d MedianOffset(std::span<const NearMatch> all, std::span<const std::pair<double, std::size_t>> neighbours,
                             std::vector<double>* scratch) {
  Eigen::Vector2d median;
  for (int axis = 0; axis < 2; ++axis) {
    scratch->clear();
    for (const auto& [distance, i] : neighbours) scratch->push_back(all[i].offset[axis]);
    median[axis] = Median(scratch);
  }
  return median;
}

}  // namespace

SmoothOffsets KeepSmoothOffsets(const CameraModel& camera, std::span<const Sim3Match> matches,
                                std::span<const SE3> views_a, std::span<const SE3> views_b,
                                const SmoothOffsetsOptions& options, std::span<std::uint8_t> kept) {
  std::fill(kept.begin(), kept.end(), std::uint8_t{0});
  std::vector<NearMatch> near;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    const Sim3Match& match = matches[m];
    Eigen::Vector2d offset, back;
    const double max_px = options.max_offset_px;
    if (!OffsetIn(camera, views_a[match.view_a], match.point_in_b, match.pixel_in_a, max_px, &offset)) continue;
    if (!OffsetIn(camera, views_b[match.view_b], match.point_in_a, match.pixel_in_b, max_px, &back)) continue;
    near.push_back({m, match.pixel_in_a, offset});
  }
  SmoothOffsets found;
  found.num_near = static_cast<int>(near.size());
  if (found.num_near <= options.min_neighbours) return found;

  std::vector<std::pair<double, std::size_t>> neighbours;
  std::vector<double> scratch;
  for (std::size_t i = 0; i < near.size(); ++i) {
    neighbours.clear();
    for (std::size_t j = 0; j < near.size(); ++j) {
      if (j != i) neighbours.emplace_back((near[j].pixel - near[i].pixel).squaredNorm(), j);
    }
    const std::size_t num = std::min(neighbours.size(), static_cast<std::size_t>(options.neighbours));
    std::partial_sort(neighbours.begin(), neighbours.begin() + static_cast<std::ptrdiff_t>(num), neighbours.end());
    const Eigen::Vector2d expected = MedianOffset(near, std::span(neighbours).first(num), &scratch);
    const double tolerated = options.max_roughness * matches[near[i].match].sigma_a_px;
    if ((near[i].offset - expected).norm() > tolerated) continue;
    kept[near[i].match] = 1;
    ++found.num_kept;
  }
  return found;
}

}  // namespace haustra
