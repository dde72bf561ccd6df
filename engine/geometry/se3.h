// Rigid transforms in double precision. `b_from_a * point_in_a = point_in_b`; adjacent frames must match in a product:
// c_from_a = c_from_b * b_from_a. Tangent vectors are (rho, phi): translation first, then rotation; perturbations act
// from the left: Exp(delta) * b_from_a (Sola, Deray, Atchuthan 2018, "A micro Lie theory"). reentrant, rt-safe.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace haustra {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Skew-symmetric matrix of v: Skew(v) * w = v x w.
inline Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

struct SE3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // kept at unit norm
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  SE3() = default;
  SE3(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) : rotation(q.normalized()), translation(t) {}
  SE3(const Eigen::Matrix3d& r, const Eigen::Vector3d& t) : SE3(Eigen::Quaterniond(r), t) {}

  Eigen::Matrix3d matrix3() const { return rotation.toRotationMatrix(); }
  SE3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return SE3(inverse, -(inverse * translation));
  }
  // Where frame a has its origin, seen from a's own coordinates of b: for cam_from_world, the camera centre in world.
  Eigen::Vector3d InverseTranslation() const { return -(rotation.conjugate() * translation); }

  static SE3 Exp(const Vector6d& rho_phi);
  Vector6d Log() const;
};

inline SE3 operator*(const SE3& c_from_b, const SE3& b_from_a) {
  return SE3(c_from_b.rotation * b_from_a.rotation, c_from_b.rotation * b_from_a.translation + c_from_b.translation);
}
inline Eigen::Vector3d operator*(const SE3& b_from_a, const Eigen::Vector3d& point_in_a) {
  return b_from_a.rotation * point_in_a + b_from_a.translation;
}

// Rotation vector (axis times angle, rad) to quaternion and back.
Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& phi);
Eigen::Vector3d LogSO3(const Eigen::Quaterniond& q);
// Angle of the rotation between two poses, [0, pi].
double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

}  // namespace haustra
