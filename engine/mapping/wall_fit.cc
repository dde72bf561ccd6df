#include "engine/mapping/wall_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

namespace haustra {
namespace {

// Points that have a say lie this near the pixel, in widths of the image; the patch itself reaches half as far.
constexpr double kReachWidths = 0.12;
constexpr double kPatchWidths = 0.06;
constexpr std::size_t kMaxWitnesses = 32;
constexpr int kMinWitnesses = 6;
// So many lie in the patch itself: a wall is not guessed from one side.
constexpr int kMinInPatch = 2;
// Of the slope of the wall against the ray, before anything is measured (tangent of the angle).
constexpr double kSlopeSigma = 2.0;
constexpr double kInverseSigma = 0.1;
constexpr int kRounds = 8;

Eigen::Vector3d AnyNormalTo(const Eigen::Vector3d& ray) {
  const Eigen::Vector3d axis = std::abs(ray.x()) < 0.5 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  return ray.cross(axis).normalized();
}

}  // namespace

WallFit::WallFit(const CameraModel& camera, int max_points) : camera_(camera) {
  samples_.reserve(static_cast<std::size_t>(max_points));
  witnesses_.reserve(static_cast<std::size_t>(max_points));
  sorted_.reserve(static_cast<std::size_t>(max_points));
}

void WallFit::Begin(const SE3& cam_from_map) {
  cam_from_map_ = cam_from_map;
  samples_.clear();
}

void WallFit::Add(const Keyframe& keyframe, const Atlas& atlas) {
  const std::size_t num_before = samples_.size();
  for (int i = 0; i < keyframe.features.num && samples_.size() < samples_.capacity(); ++i) {
    if (!keyframe.points[i]) continue;
    const Eigen::Vector3d point_in_cam = cam_from_map_ * atlas.point(keyframe.points[i]).position;
    Sample sample;
    sample.point = keyframe.points[i];
    sample.distance = point_in_cam.norm();
    if (!(sample.distance > 0.0) || !camera_.Project(point_in_cam, &sample.pixel)) continue;
    sample.ray = point_in_cam / sample.distance;
    samples_.push_back(sample);
  }
  if (num_before == 0) return;
  // Samples of the same point are the same.
  std::sort(samples_.begin(), samples_.end(),
            [](const Sample& a, const Sample& b) { return a.point.index < b.point.index; });
  const auto is_same = [](const Sample& a, const Sample& b) { return a.point == b.point; };
  samples_.erase(std::unique(samples_.begin(), samples_.end(), is_same), samples_.end());
}

// A plane m with m . point = 1 gives 1 / distance = m . ray: linear in m, whose parts along the ray and across it are
// the unknowns.
Result<FittedWall> WallFit::At(const Eigen::Vector2d& pixel) {
  Eigen::Vector3d ray;
  if (!camera_.IsInImage(pixel) || !camera_.Unproject(pixel, &ray)) {
    return InvalidArgument("the camera sees nothing at this pixel");
  }
  const double reach_px = kReachWidths * camera_.width_px(), patch_px = kPatchWidths * camera_.width_px();
  const Eigen::Vector3d across = AnyNormalTo(ray), up = ray.cross(across);
  witnesses_.clear();
  int num_in_patch = 0;
  for (const Sample& sample : samples_) {
    const double offset2_px = (sample.pixel - pixel).squaredNorm();
    if (offset2_px > reach_px * reach_px) continue;
    num_in_patch += offset2_px <= patch_px * patch_px;
    const Eigen::Vector3d row(sample.ray.dot(ray), sample.ray.dot(across), sample.ray.dot(up));
    witnesses_.push_back({offset2_px, row, 1.0 / sample.distance, 0.0});
  }
  if (static_cast<int>(witnesses_.size()) < kMinWitnesses || num_in_patch < kMinInPatch) {
    return FailedPrecondition("too little of the map is near: " + std::to_string(witnesses_.size()) +
                              " points around the pixel, " + std::to_string(num_in_patch) + " at it");
  }
  std::sort(witnesses_.begin(), witnesses_.end(),
            [](const Witness& a, const Witness& b) { return a.offset2_px < b.offset2_px; });
  witnesses_.resize(std::min(witnesses_.size(), kMaxWitnesses));

  // In units of the median of the nearer half.
  sorted_.clear();
  const std::size_t num_nearer = std::max<std::size_t>(kMinWitnesses, witnesses_.size() / 2);
  for (std::size_t i = 0; i < std::min(num_nearer, witnesses_.size()); ++i) sorted_.push_back(witnesses_[i].inverse);
  std::nth_element(sorted_.begin(), sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2), sorted_.end());
  const double unit = sorted_[sorted_.size() / 2];
  for (Witness& witness : witnesses_) {
    witness.inverse /= unit;
    witness.weight = std::exp(-witness.offset2_px / (2.0 * patch_px * patch_px));
  }

  // Reweighted least squares with a weak wish for a wall that faces the camera.
  Eigen::Vector3d plane = Eigen::Vector3d::UnitX();
  const double wish = kInverseSigma * kInverseSigma / (kSlopeSigma * kSlopeSigma);
  for (int round = 0; round < kRounds; ++round) {
    // What is far off at first may be slope.
    const double tolerance = kSameWall * std::max(1.0, 3.0 - round);
    Eigen::Matrix3d normal_matrix = Eigen::Vector3d(0.0, wish, wish).asDiagonal();
    Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
    for (const Witness& witness : witnesses_) {
      const double residual = (witness.row.dot(plane) - witness.inverse) / tolerance;
      const double robust = 1.0 / ((1.0 + residual * residual) * (1.0 + residual * residual));
      const double weight = witness.weight * robust;
      normal_matrix += weight * witness.row * witness.row.transpose();
      right_side += weight * witness.inverse * witness.row;
    }
    const Eigen::Vector3d next = normal_matrix.ldlt().solve(right_side);
    if (!next.allFinite() || next.x() <= 0.0) break;
    plane = next;
  }
  int num_agreeing = 0;
  double agreeing = 0.0, all = 0.0;
  for (const Witness& witness : witnesses_) {
    const bool agrees = std::abs(witness.row.dot(plane) - witness.inverse) <= kSameWall * plane.x();
    num_agreeing += agrees;
    agreeing += agrees ? witness.weight : 0.0;
    all += witness.weight;
  }
  if (num_agreeing < kMinWitnesses || 2.0 * agreeing < all) {
    return FailedPrecondition("the map is not clear about the wall there: " + std::to_string(num_agreeing) + " of " +
                              std::to_string(witnesses_.size()) + " points agree");
  }
  FittedWall patch;
  patch.distance = 1.0 / (unit * plane.x());
  patch.normal_in_cam = -(plane.x() * ray + plane.y() * across + plane.z() * up).normalized();
  patch.radius = patch.distance * patch_px / camera_.focal_px();
  patch.num_agreeing = num_agreeing;
  return patch;
}

}  // namespace haustra
