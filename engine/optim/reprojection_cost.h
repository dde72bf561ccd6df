// The residual of bundle adjustment for Ceres, with analytic Jacobians. Private to engine/optim and its tests.
#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>

#include "engine/camera/camera_model.h"
#include "engine/optim/bundle_adjustment.h"
#include "engine/optim/se3_manifold.h"

namespace haustra::optim {

// Reprojection error in units of sigma of one observation; parameters: pose (see LeftSE3Manifold), point (3).
class ReprojectionCost final : public ceres::SizedCostFunction<2, LeftSE3Manifold::kAmbientSize, 3> {
 public:
  ReprojectionCost(const CameraModel& camera, const BundleObservation& observation, double unseen_residual)
      : camera_(&camera),
        pixel_(observation.pixel),
        inverse_sigma_(1.0 / observation.sigma_px),
        unseen_residual_(unseen_residual) {}

  // A dropped observation stays in the problem with no weight: that costs less than building the problem again.
  void Drop() {
    inverse_sigma_ = 0.0;
    unseen_residual_ = 0.0;
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Quaterniond> rotation(parameters[0]);
    const Eigen::Map<const Eigen::Vector3d> translation(parameters[0] + 4);
    const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    const Eigen::Matrix3d cam_from_world = rotation.toRotationMatrix();
    const Eigen::Vector3d point_in_cam = cam_from_world * point + translation;

    Eigen::Vector2d pixel;
    CameraModel::ProjectionJacobian d_pixel;
    const bool is_seen = jacobians != nullptr ? camera_->Project(point_in_cam, &pixel, &d_pixel)
                                              : camera_->Project(point_in_cam, &pixel);
    if (!is_seen) {
      residual << unseen_residual_, 0.0;
      if (jacobians != nullptr && jacobians[0] != nullptr) std::fill_n(jacobians[0], 2 * 7, 0.0);
      if (jacobians != nullptr && jacobians[1] != nullptr) std::fill_n(jacobians[1], 2 * 3, 0.0);
      return true;
    }
    residual = inverse_sigma_ * (pixel - pixel_);
    if (jacobians == nullptr) return true;
    d_pixel *= inverse_sigma_;
    if (jacobians[0] != nullptr) {
      // d (Exp(delta) * point_in_cam) / d delta = [I, -Skew(point_in_cam)].
      Eigen::Map<Eigen::Matrix<double, 2, LeftSE3Manifold::kAmbientSize, Eigen::RowMajor>> d_pose(jacobians[0]);
      d_pose.leftCols<3>() = d_pixel;
      d_pose.middleCols<3>(3).noalias() = -d_pixel * Skew(point_in_cam);
      d_pose.col(6).setZero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> d_point(jacobians[1]);
      d_point.noalias() = d_pixel * cam_from_world;
    }
    return true;
  }

 private:
  const CameraModel* camera_;
  Eigen::Vector2d pixel_;
  double inverse_sigma_;
  double unseen_residual_;
};

}  // namespace haustra::optim
