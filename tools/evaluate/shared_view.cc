#include "tools/evaluate/shared_view.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"

namespace haustra::evaluate {
namespace {

constexpr double kNearDepths = 0.5;
constexpr double kFarDepths = 1.5;
constexpr int kGridColumns = 8;
constexpr int kGridRows = 6;
constexpr int kShells = 4;

}  // namespace

SharedView::SharedView(const CameraModel& camera) : camera_(camera) {
  const double near3 = std::pow(kNearDepths, 3), far3 = std::pow(kFarDepths, 3);
  for (int row = 0; row < kGridRows; ++row) {
    for (int column = 0; column < kGridColumns; ++column) {
      const Eigen::Vector2d pixel(camera.width_px() * (column + 0.5) / kGridColumns - 0.5,
                                  camera.height_px() * (row + 0.5) / kGridRows - 0.5);
      Eigen::Vector3d bearing;
      if (!camera.Unproject(pixel, &bearing)) continue;
      for (int shell = 0; shell < kShells; ++shell) {
        samples_.push_back(bearing * std::cbrt(near3 + (far3 - near3) * (shell + 0.5) / kShells));
      }
    }
  }
}

double SharedView::VolumeInCommon(const View& a, const View& b) const {
  if (samples_.empty()) return 0.0;
  const SE3 b_from_a = b.world_from_cam.Inverse() * a.world_from_cam;
  std::size_t num_inside = 0;
  for (const Eigen::Vector3d& sample : samples_) {
    const Eigen::Vector3d point_in_b = b_from_a * Eigen::Vector3d(a.depth * sample);
    const double distance = point_in_b.norm();
    Eigen::Vector2d pixel;
    if (distance < kNearDepths * b.depth || distance > kFarDepths * b.depth) continue;
    if (camera_.Project(point_in_b, &pixel) && camera_.IsInImage(pixel)) ++num_inside;
  }
  return static_cast<double>(num_inside) / static_cast<double>(samples_.size());
}

bool SharedView::Holds(const View& a, const View& b) const {
  const double distance = (a.world_from_cam.translation - b.world_from_cam.translation).norm();
  if (distance > kFarDepths * (a.depth + b.depth)) return false;
  if (AxisAngleDeg(a.world_from_cam, b.world_from_cam) >= kMaxSharedAngleDeg) return false;
  return VolumeInCommon(a, b) >= kMinSharedVolume && VolumeInCommon(b, a) >= kMinSharedVolume;
}

double AxisAngleDeg(const SE3& world_from_cam_a, const SE3& world_from_cam_b) {
  const Eigen::Vector3d a = world_from_cam_a.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d b = world_from_cam_b.rotation * Eigen::Vector3d::UnitZ();
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * kDegPerRad;
}

std::vector<std::size_t> SelectViews(const std::vector<View>& views) {
  constexpr double kStepDepths = 0.1;
  constexpr double kStepDeg = 10.0;
  std::vector<std::size_t> selected;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!selected.empty()) {
      const View& last = views[selected.back()];
      const double moved = (views[i].world_from_cam.translation - last.world_from_cam.translation).norm();
      const double turned = RotationAngle(views[i].world_from_cam.rotation, last.world_from_cam.rotation) * kDegPerRad;
      if (moved < kStepDepths * last.depth && turned < kStepDeg) continue;
    }
    selected.push_back(i);
  }
  return selected;
}

}  // namespace haustra::evaluate
