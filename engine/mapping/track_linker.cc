#include "engine/mapping/track_linker.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"
#include "engine/geometry/rng_streams.h"

namespace haustra {
namespace {

// Measured against expected inverse depth, in sigmas of both: beyond it the match is false, or the wall ends there.
constexpr double kMaxDepthSigmas = 4.0;
// Farther than this many times the wall around it a point is not placed: positions would lose their meaning.
constexpr double kMaxDepthFactor = 20.0;

// Two views of the same scene that stand at one place agree on epipolar geometry, too: here it only has to tell false
// matches.
TwoViewRansac::Options VerificationOptions() {
  TwoViewRansac::Options options;
  options.max_iterations = 200;
  options.max_runner_up_share = 1.0;
  options.min_rival_lead = 0.0;
  options.min_moving_share = 0.0;
  return options;
}

}  // namespace

TrackLinker::TrackLinker(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                         VisionDevice& device)
    : config_(config),
      noise_(noise),
      camera_(camera),
      pair_(config, noise, camera, device),
      ransac_(config.features.max),
      rng_(config.seed, rng_stream::kTrackLinks) {}

int TrackLinker::Link(KeyframeHandle handle, std::span<const Covisible> neighbours, Atlas* atlas,
                      std::vector<MapPointHandle>* created) {
  int num_gained = 0;
  surface_.Load(atlas->keyframe(handle), *atlas);
  const auto num = std::min(neighbours.size(), static_cast<std::size_t>(config_.mapping.link_neighbours));
  for (const Covisible& neighbour : neighbours.first(num)) {
    const Keyframe& a = atlas->keyframe(handle);
    const Keyframe& b = atlas->keyframe(neighbour.keyframe);
    if (!MatchAndVerify(a, b)) continue;
    for (std::size_t m = 0; m < pair_.matches().size(); ++m) {
      const Match& match = pair_.matches()[m];
      if (ransac_.inliers()[m] == 0 || a.points[match.query]) continue;
      const MapPointHandle known = b.points[match.train];
      if (known) {
        if (!IsNear(a, match.query, atlas->point(known).position)) continue;
        if (!atlas->AddObservation(known, handle, match.query)) continue;
        atlas->UpdatePoint(known);
        ++num_gained;
        continue;
      }
      Eigen::Vector3d in_map;
      if (!Place(a, b, match, &in_map)) continue;
      const MapPointHandle point = atlas->AddPoint(a.map, in_map, a.id);
      if (!point) return num_gained;
      atlas->AddObservation(point, handle, match.query);
      atlas->AddObservation(point, neighbour.keyframe, match.train);
      atlas->UpdatePoint(point);
      created->push_back(point);
    }
  }
  return num_gained;
}

bool TrackLinker::MatchAndVerify(const Keyframe& a, const Keyframe& b) {
  TwoViewRansac::Estimate estimate;
  return pair_.Compare(a, b) && ransac_.Run(pair_.bearings_a(), pair_.bearings_b(), pair_.tolerance_rad(),
                                            VerificationOptions(), rng_, &estimate);
}

// The pose that guided search started from is not off by more than its window.
bool TrackLinker::IsNear(const Keyframe& keyframe, int feature, const Eigen::Vector3d& position) const {
  Eigen::Vector2d pixel;
  return camera_.Project(keyframe.cam_from_map * position, &pixel) &&
         (pixel - keyframe.features.pixel(feature)).norm() <
             config_.tracking.motion_radius_deg * kDegree * camera_.focal_px();
}

// On the ray of `a`, at the depth that both views and the wall around it make most likely.
bool TrackLinker::Place(const Keyframe& a, const Keyframe& b, const Match& match, Eigen::Vector3d* in_map) {
  double surface = 0.0;
  if (!surface_.At(a.features.pixel(match.query), &surface) || !(surface > 0.0)) return false;
  const InverseDepth expected = {1.0 / surface, config_.mapping.surface_spread / surface};
  const SE3 a_from_b = a.cam_from_map * b.cam_from_map.Inverse();
  const Eigen::Vector3d ray_a = a.features.bearing(match.query);
  const Eigen::Vector3d ray_b = a_from_b.matrix3() * b.features.bearing(match.train);
  const double scale = std::max(a.features.keypoints[match.query].scale_px, b.features.keypoints[match.train].scale_px);
  const double sigma_rad = std::sqrt(2.0) * noise_.SigmaPx(scale) / camera_.focal_px();
  InverseDepth depth = expected;
  InverseDepth measured;
  if (MeasureInverseDepth(ray_a, ray_b, a_from_b.translation, sigma_rad, &measured)) {
    const double gate = kMaxDepthSigmas * std::hypot(measured.sigma, expected.sigma);
    if (std::abs(measured.value - expected.value) > gate) return false;
    depth = Combine(measured, expected);
  }
  if (!(depth.value * surface * kMaxDepthFactor > 1.0)) return false;
  *in_map = a.cam_from_map.Inverse() * Eigen::Vector3d(ray_a / depth.value);
  return true;
}

}  // namespace haustra
