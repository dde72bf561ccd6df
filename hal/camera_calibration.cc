#include "hal/camera_calibration.h"

namespace haustra {

CameraCalibration Halved(const CameraCalibration& calibration) {
  CameraCalibration half = calibration;
  half.width_px = calibration.width_px / 2;
  half.height_px = calibration.height_px / 2;
  half.fx = calibration.fx / 2;
  half.fy = calibration.fy / 2;
  half.cx = HalvedPixel(calibration.cx);
  half.cy = HalvedPixel(calibration.cy);
  if (calibration.kind == CameraModelKind::kOcamCalib) {
    // z'(rho') = z(2 rho') / 2.
    half.coefficients[0] = calibration.coefficients[0] / 2;
    half.coefficients[1] = calibration.coefficients[1] * 2;
    half.coefficients[2] = calibration.coefficients[2] * 4;
    half.coefficients[3] = calibration.coefficients[3] * 8;
  }
  return half;
}

}  // namespace haustra
