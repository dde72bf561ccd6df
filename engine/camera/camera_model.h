// Projection of points in camera coordinates to pixels and back to unit bearings, with analytic Jacobians, for the
// closed set of models of hal/camera_calibration.h: pinhole with radial-tangential distortion (Brown 1966),
// Kannala-Brandt fisheye (2006) and OCamCalib (Scaramuzza 2006). Camera axes: x right, y down, z forward; pixel centres
// at integers. Immutable after Create; reentrant, rt-safe. Either direction, with or without Jacobian, takes 10 to 90
// ns on one x86-64 core (the iterated ones start from a table, so that two Newton steps reach double precision).
#pragma once

#include <Eigen/Core>
#include <array>

#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "hal/projection_constants.h"

namespace haustra {

class CameraModel {
 public:
  using ProjectionJacobian = Eigen::Matrix<double, 2, 3>;

  CameraModel() = default;
  // kInvalidArgument: not finite, focal length or size not positive, principal point far outside, or a model that is
  // not monotonic anywhere near the image; the message names the parameter and its value.
  static Result<CameraModel> Create(const CameraCalibration& calibration);

  const CameraCalibration& calibration() const { return calibration_; }
  int width_px() const { return calibration_.width_px; }
  int height_px() const { return calibration_.height_px; }
  // Largest angle to the optical axis at which the model holds (monotonic, inside what the image needs), rad. The image
  // needs a quarter more than the radius of its farthest corner, so that a pose a little off still projects what it
  // sees.
  double max_half_angle_rad() const { return max_half_angle_rad_; }
  // Pixels per radian at the image centre.
  double focal_px() const { return focal_px_; }

  // False when the point lies beyond max_half_angle_rad (or at the centre). The pixel may lie outside the image.
  bool Project(const Eigen::Vector3d& point_in_cam, Eigen::Vector2d* pixel) const;
  // The same with d pixel / d point.
  bool Project(const Eigen::Vector3d& point_in_cam, Eigen::Vector2d* pixel, ProjectionJacobian* jacobian) const;
  // Unit vector; false when the pixel lies beyond the edge of the model.
  bool Unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* bearing_in_cam) const;

  // Whether the pixel lies inside the image, at least `margin_px` from its edge.
  bool IsInImage(const Eigen::Vector2d& pixel, double margin_px = 0.0) const {
    return pixel.x() >= margin_px && pixel.y() >= margin_px && pixel.x() <= width_px() - 1 - margin_px &&
           pixel.y() <= height_px() - 1 - margin_px;
  }
  // For the projection of several points at once (lane_projection.h). Points into this model.
  ProjectionConstants projection_constants() const;

 private:
  static constexpr int kTableIntervals = 256;

  // The radial curve of the fisheye models, angle to the axis (rad) against radius in the distorted plane, both ways.
  // Kannala-Brandt has the radius in closed form, OCamCalib the angle; the other direction is Newton from the table.
  double RadiusOfAngle(double angle, double* derivative) const;
  double AngleOfRadius(double radius) const;

  // Pixel offset from the principal point to the distorted plane and back: focal lengths, or the affine part of
  // OCamCalib.
  Eigen::Vector2d DistortedFromPixel(const Eigen::Vector2d& pixel) const;
  Eigen::Vector2d PixelFromDistorted(const Eigen::Vector2d& distorted) const;

  Status FindLimits();
  double TableGuess(double argument) const;

  CameraCalibration calibration_;
  double max_half_angle_rad_ = 0.0;
  double max_radius_ = 0.0;   // of the distorted plane, at max_half_angle_rad_
  double max_tangent_ = 0.0;  // of max_half_angle_rad_, pinhole only
  double focal_px_ = 0.0;
  Eigen::Matrix2d pixel_from_distorted_ = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d distorted_from_pixel_ = Eigen::Matrix2d::Identity();
  // Inverse of the closed-form direction at equal steps of its value, [0, limit]; for the pinhole, undistorted against
  // distorted radius.
  std::array<double, kTableIntervals + 1> inverse_table_{};
  double table_intervals_per_unit_ = 0.0;
};

}  // namespace haustra
