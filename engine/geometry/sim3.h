// Similarity transforms: point_in_b = scale * rotation * point_in_a + translation. Frames as in se3.h. A monocular map
// has its own scale and origin, so two maps, or a map and the ground truth, differ by one of these. reentrant, rt-safe.
#pragma once

#include <span>

#include "engine/geometry/se3.h"

namespace haustra {

struct Sim3 {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Sim3() = default;
  Sim3(double s, const Eigen::Quaterniond& q, const Eigen::Vector3d& t)
      : scale(s), rotation(q.normalized()), translation(t) {}
  explicit Sim3(const SE3& rigid) : Sim3(1.0, rigid.rotation, rigid.translation) {}

  Sim3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return Sim3(1.0 / scale, inverse, (-1.0 / scale) * (inverse * translation));
  }
};

inline Sim3 operator*(const Sim3& c_from_b, const Sim3& b_from_a) {
  return Sim3(c_from_b.scale * b_from_a.scale, c_from_b.rotation * b_from_a.rotation,
              c_from_b.scale * (c_from_b.rotation * b_from_a.translation) + c_from_b.translation);
}
inline Eigen::Vector3d operator*(const Sim3& b_from_a, const Eigen::Vector3d& point_in_a) {
  return b_from_a.scale * (b_from_a.rotation * point_in_a) + b_from_a.translation;
}

// The pose of a camera after its map moved into another frame: cam_from_b (translation in units of b) of a camera whose
// pose in a is cam_from_a, with points moved by b_from_a.
inline SE3 TransformPose(const SE3& cam_from_a, const Sim3& b_from_a) {
  // x_cam = R p_a + t; p_a = (1/s) Rs^T (p_b - ts). Scaling x_cam by s leaves its projection as it is.
  const Eigen::Quaterniond rotation = cam_from_a.rotation * b_from_a.rotation.conjugate();
  return SE3(rotation, b_from_a.scale * cam_from_a.translation - rotation * b_from_a.translation);
}

// Least-squares similarity with points_in_b[i] ~ b_from_a * points_in_a[i] (Horn 1987, Umeyama 1991). At least 3 points
// that are not on one line, of equal number; returns false otherwise, and `b_from_a` is untouched.
bool AlignSim3(std::span<const Eigen::Vector3d> points_in_a, std::span<const Eigen::Vector3d> points_in_b,
               Sim3* b_from_a);

}  // namespace haustra
