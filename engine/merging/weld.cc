#include "engine/merging/weld.h"

#include <algorithm>

namespace haustra {
namespace {

// Fewer ring keyframes leave the scale to the noise: the reference side itself then holds the gauge.
constexpr std::size_t kMinRing = 2;

}  // namespace

Weld::Weld(const EngineConfig& config, const MergingConfig& options, const NoiseModel& noise, const CameraModel& camera,
           SchurBundleAdjuster& adjuster)
    : options_(options), window_(config.memory, noise, camera, adjuster) {}

Result<BundleSummary> Weld::Adjust(const Sides& sides, Atlas* atlas, const Clock* clock, TimePoint deadline) {
  window_.Clear();
  for (const std::span<const KeyframeHandle> side : {sides.moving, sides.reference}) {
    for (const KeyframeHandle handle : side) window_.Add(handle);
  }
  window_.Close(*atlas, options_.fixed_keyframes, sides.may_hold);
  if (window_.num_fixed() < kMinRing) {
    for (std::size_t i = sides.moving.size(); i < window_.moving().size(); ++i) window_.Fix(i);
  }
  BundleOptions options;
  options.max_iterations = options_.weld_iterations;
  options.clock = clock;
  options.deadline = deadline;
  const double before = MedianDistance(sides.moving.size());
  Result<BundleSummary> summary = window_.Adjust(options, atlas);
  moving_scale_ = 1.0;
  if (summary.ok() && summary->state != SolveState::kNone) {
    const double after = MedianDistance(sides.moving.size());
    if (before > 0.0 && after > 0.0) moving_scale_ = after / before;
  }
  return summary;
}

// Between the cameras of the moving side and what they see, in the problem as it stands.
double Weld::MedianDistance(std::size_t num_moving) const {
  const BundleProblem& problem = window_.problem();
  std::vector<double> distances;
  for (const BundleObservation& observation : problem.observations) {
    if (observation.pose_idx >= static_cast<std::int32_t>(num_moving)) continue;
    const Eigen::Vector3d centre = problem.poses[observation.pose_idx].cam_from_world.InverseTranslation();
    distances.push_back((problem.points[observation.point_idx].position - centre).norm());
  }
  if (distances.empty()) return 0.0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace haustra
