// A Kannala-Brandt camera as like another one as it can be, for formats that know no other fisheye (COLMAP has no
// OCamCalib). reentrant, not rt-safe, about a millisecond.
#pragma once

#include "engine/camera/camera_model.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra {

struct FisheyeFit {
  CameraCalibration calibration;  // kKannalaBrandt, size and rate of the original
  double rms_px = 0.0;            // distance between the two projections of one ray, over the image
  double max_px = 0.0;
};

// Least squares over a regular grid of the image: each grid pixel is unprojected by `camera` and projected by the
// fisheye (Levenberg-Marquardt on fx fy cx cy k1 k2 k3 k4). The shear of OCamCalib's affine part has no counterpart and
// stays in the residual. kInvalidArgument: hardly any pixel of the image has a ray; kInternal: the fit is no camera.
Result<FisheyeFit> FitFisheye(const CameraModel& camera);

}  // namespace haustra
