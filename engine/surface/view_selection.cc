#include "engine/surface/view_selection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace haustra {
namespace {

constexpr double kBestAngleDeg = 8.0, kSigmaBelowDeg = 3.0, kSigmaAboveDeg = 12.0;

double Usefulness(const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b) {
  const double angle_deg = std::atan2(ray_a.cross(ray_b).norm(), ray_a.dot(ray_b)) * 180.0 / std::numbers::pi;
  const double off = (angle_deg - kBestAngleDeg) / (angle_deg < kBestAngleDeg ? kSigmaBelowDeg : kSigmaAboveDeg);
  return std::exp(-0.5 * off * off);
}

double Score(const SeeingView& a, const SeeingView& b) {
  double score = 0.0;
  auto other = b.points.begin();
  for (const SeenPoint& point : a.points) {
    while (other != b.points.end() && other->point_id < point.point_id) ++other;
    if (other == b.points.end()) break;
    if (other->point_id != point.point_id) continue;
    score += Usefulness(point.position_in_map - a.centre_in_map, point.position_in_map - b.centre_in_map);
  }
  return score;
}

}  // namespace

std::vector<int> SelectSources(std::span<const SeeingView> views, int reference, int max_sources, double min_score) {
  std::vector<std::pair<double, int>> scored;
  for (int i = 0; i < static_cast<int>(views.size()); ++i) {
    if (i == reference) continue;
    const double score = Score(views[reference], views[i]);
    if (score >= min_score) scored.emplace_back(-score, i);
  }
  std::sort(scored.begin(), scored.end());  // equal scores: by place, so that the answer is always the same
  if (static_cast<int>(scored.size()) > max_sources) scored.resize(max_sources);
  std::vector<int> sources;
  for (const auto& [score, view] : scored) sources.push_back(view);
  return sources;
}

}  // namespace haustra
