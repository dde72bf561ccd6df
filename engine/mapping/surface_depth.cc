#include "engine/mapping/surface_depth.h"

#include <algorithm>
#include <cmath>

namespace haustra {
namespace {

// Enough for a median, few enough to stay on one fold.
constexpr std::size_t kNeighbours = 8;

}  // namespace

bool MeasureInverseDepth(const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b, const Eigen::Vector3d& b_in_a,
                         double sigma_rad, InverseDepth* out) {
  const Eigen::Vector3d normal = ray_a.cross(b_in_a);  // of the epipolar plane
  const double baseline = ray_b.cross(b_in_a).norm();  // as b sees it
  if (!(normal.norm() > 0.0) || !(baseline > 0.0)) return false;
  // The law of sines in the triangle of both centres and the point.
  const double sine = normal.normalized().dot(ray_b.cross(ray_a));
  out->value = sine / baseline;
  out->sigma = sigma_rad / baseline;
  return std::isfinite(out->value) && std::isfinite(out->sigma);
}

InverseDepth Combine(const InverseDepth& a, const InverseDepth& b) {
  const double of_a = 1.0 / (a.sigma * a.sigma), of_b = 1.0 / (b.sigma * b.sigma);
  return {(of_a * a.value + of_b * b.value) / (of_a + of_b), 1.0 / std::sqrt(of_a + of_b)};
}

void SurfaceDepth::Load(const Keyframe& keyframe, const Atlas& atlas) {
  samples_.clear();
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i]) continue;
    const double depth = (keyframe.cam_from_map * atlas.point(keyframe.points[i]).position).norm();
    samples_.push_back({keyframe.features.pixel(i), depth});
  }
}

bool SurfaceDepth::At(const Eigen::Vector2d& pixel, double* depth) {
  if (samples_.size() < kNeighbours) return false;
  neighbours_.clear();
  for (const Sample& sample : samples_) neighbours_.push_back({(sample.pixel - pixel).squaredNorm(), sample.depth});
  const auto end = neighbours_.begin() + kNeighbours, middle = neighbours_.begin() + kNeighbours / 2;
  std::nth_element(neighbours_.begin(), end - 1, neighbours_.end(),
                   [](const Neighbour& a, const Neighbour& b) { return a.distance2 < b.distance2; });
  std::nth_element(neighbours_.begin(), middle, end,
                   [](const Neighbour& a, const Neighbour& b) { return a.depth < b.depth; });
  *depth = middle->depth;
  return true;
}

}  // namespace haustra
