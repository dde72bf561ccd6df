#include "engine/mapping/wall_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

namespace haustra {
namespace {

// Points that have a say lie this near the pixel, in widths of the image; the patch itself reaches half as far.
constexpr double kReachWidths = 0.12;
constexpr double kPatchWidths = 0.06;
// So many lie in the patch itself: a wall is not guessed from one side.
constexpr int kMinInPatch = 2;

// Features of a fold's edge lie as much as this beyond it, by their size, in widths. What lies behind the edge is not
// seen by all keyframes, and has its first points farther away.
constexpr double kOverhangWidths = 0.01;

Eigen::Vector3d AnyNormalTo(const Eigen::Vector3d& ray) {
  const Eigen::Vector3d axis = std::abs(ray.x()) < 0.5 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  return ray.cross(axis).normalized();
}

}  // namespace

WallFit::WallFit(const CameraModel& camera, int max_points) : camera_(camera) {
  samples_.reserve(static_cast<std::size_t>(max_points));
  near_.reserve(static_cast<std::size_t>(max_points));
  witnesses_.reserve(kMaxWallWitnesses);
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

Result<FittedWall> WallFit::At(const Eigen::Vector2d& pixel) {
  Eigen::Vector3d ray;
  if (!camera_.IsInImage(pixel) || !camera_.Unproject(pixel, &ray)) {
    return InvalidArgument("the camera sees nothing at this pixel");
  }
  const double reach_px = kReachWidths * camera_.width_px(), patch_px = kPatchWidths * camera_.width_px();
  const Eigen::Vector3d across = AnyNormalTo(ray), up = ray.cross(across);
  near_.clear();
  int num_in_patch = 0;
  for (const Sample& sample : samples_) {
    const double offset2_px = (sample.pixel - pixel).squaredNorm();
    if (offset2_px > reach_px * reach_px) continue;
    num_in_patch += offset2_px <= patch_px * patch_px;
    near_.push_back({offset2_px, &sample});
  }
  if (near_.size() < kMinWallWitnesses || num_in_patch < kMinInPatch) {
    return FailedPrecondition("too little of the map is near: " + std::to_string(near_.size()) +
                              " points around the pixel, " + std::to_string(num_in_patch) + " at it");
  }
  const auto is_nearer = [](const Near& a, const Near& b) { return a.offset2_px < b.offset2_px; };
  std::sort(near_.begin(), near_.end(), is_nearer);
  near_.resize(std::min(near_.size(), kMaxWallWitnesses));

  // In units of the median of the nearer half.
  sorted_.clear();
  const std::size_t num_nearer = std::max(kMinWallWitnesses, std::min(near_.size(), kMaxWideWitnesses) / 2);
  for (std::size_t i = 0; i < num_nearer; ++i) sorted_.push_back(1.0 / near_[i].sample->distance);
  std::nth_element(sorted_.begin(), sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2), sorted_.end());
  const double unit = sorted_[sorted_.size() / 2];
  witnesses_.clear();
  for (const Near& near : near_) {
    const Sample& sample = *near.sample;
    const Eigen::Vector3d row(sample.ray.dot(ray), sample.ray.dot(across), sample.ray.dot(up));
    const double weight = std::exp(-near.offset2_px / (2.0 * patch_px * patch_px));
    witnesses_.push_back({sample.pixel - pixel, row, 1.0 / sample.distance / unit, weight});
  }

  const WallPlane wall = FitWallPlane(witnesses_, kOverhangWidths * camera_.width_px());
  const Eigen::Vector3d& plane = wall.m;
  int num_agreeing = 0;
  double agreeing = 0.0, all = 0.0;
  for (std::size_t i = 0; i < witnesses_.size(); ++i) {
    if (!IsMember(wall.members, i)) continue;
    const WallWitness& witness = witnesses_[i];
    const bool agrees = std::abs(witness.row.dot(plane) - witness.inverse) <= kSameWall * plane.x();
    num_agreeing += agrees;
    agreeing += agrees ? witness.weight : 0.0;
    all += witness.weight;
  }
  if (num_agreeing < static_cast<int>(kMinWallWitnesses) || 2.0 * agreeing < all) {
    return FailedPrecondition("the map is not clear about the wall there: " + std::to_string(num_agreeing) + " of " +
                              std::to_string(std::popcount(wall.members)) + " points agree");
  }
  FittedWall patch;
  patch.distance = 1.0 / (unit * plane.x());
  patch.normal_in_cam = -(plane.x() * ray + plane.y() * across + plane.z() * up).normalized();
  patch.radius = patch.distance * patch_px / camera_.focal_px();
  patch.num_agreeing = num_agreeing;
  return patch;
}

}  // namespace haustra
