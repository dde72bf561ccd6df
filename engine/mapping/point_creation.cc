#include "engine/mapping/point_creation.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"
#include "engine/geometry/triangulation.h"

namespace haustra {
namespace {

// Features without a point, and for every feature how far from its epipolar plane it may lie.
void ListUnmatched(const Keyframe& keyframe, const NoiseModel& noise, double focal_px, std::vector<std::int32_t>* list,
                   std::vector<float>* tolerance) {
  list->clear();
  tolerance->resize(static_cast<std::size_t>(keyframe.features.num));
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i]) list->push_back(i);
    (*tolerance)[i] =
        static_cast<float>(kGateOneDof * noise.SigmaPx(keyframe.features.keypoints[i].scale_px) / focal_px);
  }
}

}  // namespace

PointCreator::PointCreator(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                           VisionDevice& device)
    : config_(config),
      noise_(noise),
      camera_(camera),
      device_(device),
      matches_(static_cast<std::size_t>(config.features.max)) {}

void PointCreator::Create(KeyframeHandle handle, std::span<const Covisible> neighbours, Atlas* atlas,
                          std::vector<MapPointHandle>* created) {
  int used = 0;
  for (const Covisible& neighbour : neighbours) {
    const Keyframe& a = atlas->keyframe(handle);
    const Keyframe& b = atlas->keyframe(neighbour.keyframe);
    // Two views that stand at one place give no depth. The depth scale is that of the points which b sees.
    double depth = 0.0;
    int num_points = 0;
    for (int i = 0; i < b.features.num; ++i) {
      if (!b.points[i]) continue;
      depth += (b.cam_from_map * atlas->point(b.points[i]).position).norm();
      ++num_points;
    }
    if (num_points == 0) continue;
    depth /= num_points;
    const double baseline = (a.cam_from_map.InverseTranslation() - b.cam_from_map.InverseTranslation()).norm();
    if (baseline < config_.mapping.min_baseline_depth_ratio * depth) continue;
    CreateWith(handle, neighbour.keyframe, atlas, created);
    if (++used == config_.mapping.triangulation_neighbours) break;
  }
}

void PointCreator::CreateWith(KeyframeHandle handle, KeyframeHandle neighbour, Atlas* atlas,
                              std::vector<MapPointHandle>* created) {
  const Keyframe& a = atlas->keyframe(handle);
  const Keyframe& b = atlas->keyframe(neighbour);
  ListUnmatched(a, noise_, camera_.focal_px(), &unmatched_a_, &tolerance_a_);
  ListUnmatched(b, noise_, camera_.focal_px(), &unmatched_b_, &tolerance_b_);
  if (unmatched_a_.empty() || unmatched_b_.empty()) return;

  const SE3 b_from_a = b.cam_from_map * a.cam_from_map.Inverse();
  const Eigen::Matrix3d essential = Skew(b_from_a.translation.normalized()) * b_from_a.matrix3();
  EpipolarGate gate;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) gate.train_from_query_essential[r * 3 + c] = static_cast<float>(essential(r, c));
  }
  gate.query_bearings = a.features.bearings;
  gate.train_bearings = b.features.bearings;
  gate.query_tolerance = tolerance_a_;
  gate.train_tolerance = tolerance_b_;

  std::int32_t num_matches = 0;
  MatchRequest request;
  request.query = DescriptorList::Subset(a.features.set, unmatched_a_);
  request.train = DescriptorList::Subset(b.features.set, unmatched_b_);
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.mapping.triangulation_ratio), true};
  request.epipolar = &gate;
  request.matches = matches_;
  request.num_matches = &num_matches;
  if (!MatchAndWait(device_, Lane::kBackground, request).ok()) return;

  const SE3 map_from_a = a.cam_from_map.Inverse();
  for (int m = 0; m < num_matches; ++m) {
    const int feature_a = unmatched_a_[matches_[m].query];
    const int feature_b = unmatched_b_[matches_[m].train];
    Triangulated triangulated;
    if (!TriangulateBearings(b_from_a, a.features.bearing(feature_a), b.features.bearing(feature_b), &triangulated)) {
      continue;
    }
    // Tolerances are 1.96 sigma, as angles.
    const double sigma_rad = std::max(tolerance_a_[feature_a], tolerance_b_[feature_b]) / kGateOneDof;
    const double min_parallax_rad =
        std::max(config_.mapping.min_parallax_deg * kDegree, config_.mapping.min_parallax_sigmas * sigma_rad);
    if (triangulated.cos_parallax > std::cos(min_parallax_rad)) continue;
    const Eigen::Vector3d in_map = map_from_a * triangulated.point_in_a;
    if (!IsConsistent(a, feature_a, b, feature_b, in_map)) continue;
    const MapPointHandle point = atlas->AddPoint(a.map, in_map, a.id);
    if (!point) return;
    atlas->AddObservation(point, handle, feature_a);
    atlas->AddObservation(point, neighbour, feature_b);
    atlas->UpdatePoint(point);
    created->push_back(point);
  }
}

// Reprojection in both views, and the size of the feature in both views against the distances.
bool PointCreator::IsConsistent(const Keyframe& a, int feature_a, const Keyframe& b, int feature_b,
                                const Eigen::Vector3d& in_map) const {
  double size[2];
  int side = 0;
  for (const auto& [keyframe, feature] : {std::pair{&a, feature_a}, std::pair{&b, feature_b}}) {
    const Eigen::Vector3d in_cam = keyframe->cam_from_map * in_map;
    Eigen::Vector2d pixel;
    if (!camera_.Project(in_cam, &pixel)) return false;
    const double scale = keyframe->features.keypoints[feature].scale_px;
    const double sigma = noise_.SigmaPx(scale);
    if ((pixel - keyframe->features.pixel(feature)).squaredNorm() > kChi2TwoDof * sigma * sigma) return false;
    size[side++] = scale * in_cam.norm();
  }
  const double ratio = size[0] / size[1];
  return ratio < config_.matching.scale_tolerance && ratio * config_.matching.scale_tolerance > 1.0;
}

}  // namespace haustra
