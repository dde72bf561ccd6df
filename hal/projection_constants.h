// What a projection needs to know of a camera model, without anything that has code: for files that are compiled for
// one instruction set (lane_projection.h). Made by CameraModel, whose members explain the fields.
#pragma once

#include "hal/camera_calibration.h"

namespace haustra {

struct ProjectionConstants {
  CameraModelKind kind = CameraModelKind::kPinhole;
  double coefficients[8] = {};
  double pixel_from_distorted[4] = {};  // by rows
  double cx = 0.0, cy = 0.0;
  double max_half_angle_rad = 0.0;
  double max_tangent = 0.0;               // pinhole only
  const double* inverse_table = nullptr;  // of the model's life time; OCamCalib only
  double table_intervals_per_unit = 0.0;
  int num_table_intervals = 0;
};

}  // namespace haustra
