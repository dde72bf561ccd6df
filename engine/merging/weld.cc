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

void Weld::Begin(const Sides& sides, const Atlas& atlas) {
  window_.Clear();
  for (const std::span<const KeyframeHandle> side : {sides.moving, sides.reference}) {
    for (const KeyframeHandle handle : side) window_.Add(handle);
  }
  window_.Close(atlas, options_.fixed_keyframes, sides.may_hold);
  num_moving_ = sides.moving.size();
  if (window_.num_fixed() < kMinRing) {
    for (std::size_t i = num_moving_; i < window_.moving().size(); ++i) window_.Fix(i);
  }
  poses_before_.clear();
  for (std::size_t i = 0; i < keyframes().size(); ++i)
    poses_before_.push_back(window_.problem().poses[i].cam_from_world);
  summary_ = BundleSummary{};
  ListSingleViews();
  distance_before_ = MedianDistance();
  moving_scale_ = 1.0;
}

void Weld::Solve(const std::function<bool()>& should_stop) {
  BundleOptions options;
  options.max_iterations = std::max(1, options_.weld_iterations - summary_.iterations);
  options.should_stop = should_stop;
  const Result<BundleSummary> summary = window_.Solve(options);
  if (!summary.ok()) return;
  const bool is_first = summary_.iterations == 0;
  if (is_first) summary_.initial_cost = summary->initial_cost;
  summary_.iterations += summary->iterations;
  summary_.final_cost = summary->final_cost;
  summary_.num_outliers = summary->num_outliers;
  if (summary->state == SolveState::kNone) return;
  summary_.state = summary->state;
  const double distance = MedianDistance();
  if (distance_before_ > 0.0 && distance > 0.0) moving_scale_ = distance / distance_before_;
}

void Weld::ListSingleViews() {
  const BundleProblem& problem = window_.problem();
  num_views_.assign(problem.points.size(), 0);
  for (const BundleObservation& observation : problem.observations) ++num_views_[observation.point_idx];
  single_views_.clear();
  for (const BundleObservation& observation : problem.observations) {
    const auto point = static_cast<std::size_t>(observation.point_idx);
    if (num_views_[point] != 1) continue;
    single_views_.push_back({point, static_cast<std::size_t>(observation.pose_idx), problem.points[point].position});
  }
}

void Weld::WriteBack(Atlas* atlas) {
  if (summary_.state == SolveState::kNone) return;
  for (const SingleView& view : single_views_) {
    const Sim3 correction = Correction(view.keyframe, view.keyframe < num_moving_ ? moving_scale_ : 1.0);
    window_.PlacePoint(view.point, correction * view.position_before);
  }
  window_.WriteBack(atlas);
}

Sim3 Weld::Correction(std::size_t i, double growth) const {
  const Sim3 unit(1.0 / growth, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  return (unit * Sim3(window_.problem().poses[i].cam_from_world)).Inverse() * Sim3(poses_before_[i]);
}

// Between the cameras of the moving side and what they and others see, in the problem as it stands.
double Weld::MedianDistance() const {
  const BundleProblem& problem = window_.problem();
  std::vector<double> distances;
  for (const BundleObservation& observation : problem.observations) {
    if (observation.pose_idx >= static_cast<std::int32_t>(num_moving_)) continue;
    if (num_views_[observation.point_idx] == 1) continue;
    const Eigen::Vector3d centre = problem.poses[observation.pose_idx].cam_from_world.InverseTranslation();
    distances.push_back((problem.points[observation.point_idx].position - centre).norm());
  }
  if (distances.empty()) return 0.0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace haustra
