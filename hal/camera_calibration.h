// Calibration of a camera as plain data: capture/ reads it from files, engine/camera/ makes a model of it.
#pragma once

#include <array>
#include <string>

namespace haustra {

enum class CameraModelKind {
  kPinhole,        // coefficients: k1 k2 p1 p2 k3 (radial-tangential, zeros for none)
  kKannalaBrandt,  // coefficients: k1 k2 k3 k4;  r = th + k1 th^3 + k2 th^5 + k3 th^7 + k4 th^9
  kOcamCalib,      // coefficients: a0 a2 a3 a4 c d e;  z(rho) = a0 + a2 rho^2 + a3 rho^3 + a4 rho^4 (pixels);
                   //   pixel offset from the centre = [c d; e 1] * (x, y); fx and fy unused. Scaramuzza 2006
};

// Pixels, pixel centres at integer coordinates, x right, y down, z forward.
struct CameraCalibration {
  CameraModelKind kind = CameraModelKind::kKannalaBrandt;
  int width_px = 0;
  int height_px = 0;
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  std::array<double, 8> coefficients{};
  double rate_hz = 0.0;           // 0: unknown
  double max_half_angle_deg = 0;  // 0: as far as the model is monotonic
  double focal_guess_sigma = 0;   // the focal length is a guess, with this relative standard deviation; 0: it is not
};

// Where a pixel lies in the image halved by averaging 2x2 pixels, in x or in y.
constexpr double HalvedPixel(double px) { return (px + 0.5) / 2 - 0.5; }

// The calibration of that image: the centre is such a pixel; focal lengths and, for OCamCalib, the polynomial follow.
CameraCalibration Halved(const CameraCalibration& calibration);

}  // namespace haustra
