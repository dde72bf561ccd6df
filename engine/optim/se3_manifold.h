// SE(3) as a Ceres manifold: ambient vector (qx, qy, qz, qw, tx, ty, tz), tangent (rho, phi), Plus = Exp(delta) * x,
// the left perturbation of engine/geometry/se3.h. Private to engine/optim.
//
// Convention of this folder: a cost function on such a block writes its derivative by the tangent vector into the first
// six columns of the ambient Jacobian and zero into the seventh, and PlusJacobian is the identity over a row of zeros.
// Their product is then the exact tangent Jacobian, without the detour over the derivative of a unit quaternion.
#pragma once

#include <ceres/manifold.h>

#include <Eigen/Core>

#include "engine/geometry/se3.h"

namespace haustra::optim {

class LeftSE3Manifold final : public ceres::Manifold {
 public:
  static constexpr int kAmbientSize = 7;
  static constexpr int kTangentSize = 6;

  int AmbientSize() const override { return kAmbientSize; }
  int TangentSize() const override { return kTangentSize; }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    Store(SE3::Exp(Eigen::Map<const Vector6d>(delta)) * Load(x), x_plus_delta);
    return true;
  }
  bool PlusJacobian(const double* /*x*/, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, kAmbientSize, kTangentSize, Eigen::RowMajor>> matrix(jacobian);
    matrix.setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    Eigen::Map<Vector6d> difference(y_minus_x);
    difference = (Load(y) * Load(x).Inverse()).Log();
    return true;
  }
  bool MinusJacobian(const double* /*x*/, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, kTangentSize, kAmbientSize, Eigen::RowMajor>> matrix(jacobian);
    matrix.setIdentity();
    return true;
  }

  static SE3 Load(const double* x) {
    return SE3(Eigen::Quaterniond(Eigen::Map<const Eigen::Vector4d>(x)),
               Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(x + 4)));
  }
  static void Store(const SE3& pose, double* x) {
    Eigen::Map<Eigen::Vector<double, kAmbientSize>> ambient(x);
    ambient << pose.rotation.coeffs(), pose.translation;
  }
};

}  // namespace haustra::optim
