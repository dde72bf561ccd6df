#include "engine/geometry/se3.h"

#include <cmath>

namespace haustra {

Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  // sin(angle / 2) / angle with its Taylor series near zero.
  const double k = angle < 1e-6 ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  Eigen::Quaterniond q(std::cos(0.5 * angle), k * phi.x(), k * phi.y(), k * phi.z());
  q.normalize();
  return q;
}

Eigen::Vector3d LogSO3(const Eigen::Quaterniond& q) {
  // The shorter of the two rotations that q and -q stand for.
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q.vec();
  const double s = v.norm();
  if (s < 1e-9) return 2.0 * v;
  return (2.0 * std::atan2(s, sign * q.w()) / s) * v;
}

double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return LogSO3(a.conjugate() * b).norm();
}

namespace {

// Left Jacobian of SO(3): V(phi) with translation = V * rho.
Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  const Eigen::Matrix3d w = Skew(phi);
  if (angle < 1e-5) return Eigen::Matrix3d::Identity() + 0.5 * w + w * w / 6.0;
  const double a2 = angle * angle;
  return Eigen::Matrix3d::Identity() + (1.0 - std::cos(angle)) / a2 * w +
         (angle - std::sin(angle)) / (a2 * angle) * w * w;
}

}  // namespace

SE3 SE3::Exp(const Vector6d& rho_phi) {
  const Eigen::Vector3d phi = rho_phi.tail<3>();
  return SE3(ExpSO3(phi), LeftJacobian(phi) * rho_phi.head<3>());
}

Vector6d SE3::Log() const {
  Vector6d out;
  const Eigen::Vector3d phi = LogSO3(rotation);
  out.head<3>() = LeftJacobian(phi).partialPivLu().solve(translation);
  out.tail<3>() = phi;
  return out;
}

}  // namespace haustra
