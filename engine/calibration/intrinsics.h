// The intrinsics that self-calibration estimates: one focal length, the centre and two terms of Kannala-Brandt,
// r = f (th + k1 th^3 + k2 th^5), with the derivatives by all of them. Unlike CameraModel it accepts any values that an
// optimiser may try. Pixels, pixel centres at integers; camera axes x right, y down, z forward. reentrant, rt-safe.
// Kannala and Brandt 2006, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
// lenses".
#pragma once

#include <Eigen/Core>

#include "hal/camera_calibration.h"

namespace haustra::calibration {

// Order of every vector and matrix over the intrinsics: log of the focal length, cx, cy, k1, k2.
enum IntrinsicIndex : int { kLogFocal = 0, kCx = 1, kCy = 2, kK1 = 3, kK2 = 4, kNumIntrinsics = 5 };
using IntrinsicVector = Eigen::Matrix<double, kNumIntrinsics, 1>;
using IntrinsicMatrix = Eigen::Matrix<double, kNumIntrinsics, kNumIntrinsics>;

struct Intrinsics {
  double focal_px = 0.0;  // > 0
  double cx = 0.0, cy = 0.0;
  double k1 = 0.0, k2 = 0.0;

  IntrinsicVector Vector() const;
  Intrinsics Plus(const IntrinsicVector& step) const;

  // The model holds for angles to the axis up to here (radius still growing), at most 2 rad.
  double MaxAngle() const;
  // False beyond MaxAngle or at the camera centre. The derivatives may be null.
  bool Project(const Eigen::Vector3d& point_in_cam, Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* by_point,
               Eigen::Matrix<double, 2, kNumIntrinsics>* by_intrinsics) const;
  // Unit vector; false beyond the edge of the model.
  bool Unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* bearing_in_cam) const;

  CameraCalibration ToCalibration(int width_px, int height_px, double rate_hz) const;
};

}  // namespace haustra::calibration
