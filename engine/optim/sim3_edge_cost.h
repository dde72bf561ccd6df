// Sim(3) nodes and edges for Ceres, with analytic Jacobians. Private to engine/optim and its tests.
#pragma once

#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "engine/geometry/sim3.h"

namespace haustra::optim {

// Ambient vector (qx, qy, qz, qw, tx, ty, tz, log s), tangent (rho, phi, sigma), perturbed from the left:
// Plus(x, delta) = (e^sigma Exp(phi), rho) * x. Not the exponential map of Sim(3), whose translation mixes with
// rotation and scale, but a retraction with the same derivative at zero, which is all that the solver needs.
// Jacobians follow the convention of se3_manifold.h: tangent derivative first, last ambient column zero.
class LeftSim3Manifold final : public ceres::Manifold {
 public:
  static constexpr int kAmbientSize = 8;
  static constexpr int kTangentSize = 7;

  int AmbientSize() const override { return kAmbientSize; }
  int TangentSize() const override { return kTangentSize; }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const Sim3 step(std::exp(delta[6]), ExpSO3(Eigen::Vector3d(delta[3], delta[4], delta[5])),
                    Eigen::Vector3d(delta[0], delta[1], delta[2]));
    Store(step * Load(x), x_plus_delta);
    return true;
  }
  bool PlusJacobian(const double* /*x*/, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, kAmbientSize, kTangentSize, Eigen::RowMajor>> matrix(jacobian);
    matrix.setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    const Sim3 step = Load(y) * Load(x).Inverse();
    Eigen::Map<Eigen::Vector<double, kTangentSize>> difference(y_minus_x);
    difference << step.translation, LogSO3(step.rotation), std::log(step.scale);
    return true;
  }
  bool MinusJacobian(const double* /*x*/, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, kTangentSize, kAmbientSize, Eigen::RowMajor>> matrix(jacobian);
    matrix.setIdentity();
    return true;
  }

  static Sim3 Load(const double* x) {
    return Sim3(std::exp(x[7]), Eigen::Quaterniond(Eigen::Map<const Eigen::Vector4d>(x)),
                Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(x + 4)));
  }
  static void Store(const Sim3& transform, double* x) {
    Eigen::Map<Eigen::Vector<double, kAmbientSize>> ambient(x);
    ambient << transform.rotation.coeffs(), transform.translation, std::log(transform.scale);
  }
};

// Inverse of the left Jacobian of SO(3): Log(Exp(d) * Exp(phi)) = phi + LeftJacobianInverse(phi) * d + O(d^2).
// Sola, Deray, Atchuthan 2018, equation 146.
inline Eigen::Matrix3d LeftJacobianInverseSO3(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  const Eigen::Matrix3d w = Skew(phi);
  // 1 / a^2 - (1 + cos a) / (2 a sin a) with its Taylor series near zero; near pi the fraction goes to zero.
  const double k =
      angle < 1e-4 ? 1.0 / 12.0 + angle * angle / 720.0 : 1.0 / (angle * angle) - 0.5 / (angle * std::tan(0.5 * angle));
  return Eigen::Matrix3d::Identity() - 0.5 * w + k * w * w;
}

// How far two nodes are from the transform measured between them. E = b_from_a * a_from_world * world_from_b is the
// identity when they agree; the residual is (translation / unit, rotation vector, log scale) of E times `root_weight`.
// Parameters: a_from_world and b_from_world.
class Sim3EdgeCost final
    : public ceres::SizedCostFunction<7, LeftSim3Manifold::kAmbientSize, LeftSim3Manifold::kAmbientSize> {
 public:
  Sim3EdgeCost(const Sim3& b_from_a, double root_weight, double translation_unit)
      : b_from_a_(b_from_a), root_weight_(root_weight), translation_weight_(root_weight / translation_unit) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Sim3 a_from_b = LeftSim3Manifold::Load(parameters[0]) * LeftSim3Manifold::Load(parameters[1]).Inverse();
    const Sim3 error = b_from_a_ * a_from_b;
    const Eigen::Vector3d phi = LogSO3(error.rotation);
    Eigen::Map<Eigen::Vector<double, 7>> residual(residuals);
    residual << translation_weight_ * error.translation, root_weight_ * phi, root_weight_ * std::log(error.scale);
    if (jacobians == nullptr) return true;

    using Jacobian = Eigen::Matrix<double, 7, LeftSim3Manifold::kAmbientSize, Eigen::RowMajor>;
    const Eigen::Matrix3d d_phi = root_weight_ * LeftJacobianInverseSO3(phi);
    if (jacobians[0] != nullptr) {
      // a_from_world moves from the left: E = b_from_a * Exp(delta) * a_from_b.
      Eigen::Map<Jacobian> d_a(jacobians[0]);
      d_a.setZero();
      const Eigen::Matrix3d rotation = b_from_a_.rotation.toRotationMatrix();
      const Eigen::Matrix3d scaled = translation_weight_ * b_from_a_.scale * rotation;
      d_a.block<3, 3>(0, 0) = scaled;
      d_a.block<3, 3>(0, 3) = -scaled * Skew(a_from_b.translation);
      d_a.block<3, 1>(0, 6) = scaled * a_from_b.translation;
      d_a.block<3, 3>(3, 3) = d_phi * rotation;
      d_a(6, 6) = root_weight_;
    }
    if (jacobians[1] != nullptr) {
      // b_from_world moves from the left: E * Exp(delta)^-1.
      Eigen::Map<Jacobian> d_b(jacobians[1]);
      d_b.setZero();
      const Eigen::Matrix3d rotation = error.rotation.toRotationMatrix();
      d_b.block<3, 3>(0, 0) = -translation_weight_ * error.scale * rotation;
      d_b.block<3, 3>(3, 3) = -d_phi * rotation;
      d_b(6, 6) = -root_weight_;
    }
    return true;
  }

 private:
  Sim3 b_from_a_;
  double root_weight_;
  double translation_weight_;
};

}  // namespace haustra::optim
