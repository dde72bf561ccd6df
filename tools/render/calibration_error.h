// How the written calibration differs from the camera that took the pictures, as a calibration by hand does. reentrant.
#pragma once

#include <string_view>

#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra::render {

struct CalibrationError {
  double focal_percent = 0.0;       // both focal lengths; [-20, 20]
  double cx_px = 0.0, cy_px = 0.0;  // principal point; at most a tenth of the picture's width
  double k1 = 0.0;                  // added to the first coefficient; [-0.1, 0.1]

  bool is_none() const { return focal_percent == 0.0 && cx_px == 0.0 && cy_px == 0.0 && k1 == 0.0; }
  // kInvalidArgument names what is out of range.
  Status Validate(int width_px) const;
};

// "F[,CX,CY,K1]": per cent, pixels, pixels, coefficient; what is left out is 0. kInvalidArgument names the text.
Result<CalibrationError> ParseCalibrationError(std::string_view text);

// What somebody would write who errs by that much.
CameraCalibration Misjudged(const CameraCalibration& truth, const CalibrationError& error);

}  // namespace haustra::render
