#include <cmath>

#include "capture/calibration/formats.h"
#include "capture/number.h"

namespace haustra::capture::internal {

Status CheckCalibration(const CameraCalibration& calibration,
                        const std::function<std::string(std::string_view field)>& where) {
  const auto refuse = [&](std::string_view field, double value, const std::string& why) {
    return InvalidArgument(where(field) + " is " + FormatDouble(value) + ", " + why);
  };
  const auto check_side = [&](std::string_view field, int side) {
    if (side >= kMinImageSidePx && side <= kMaxImageSidePx) return Status::Ok();
    return refuse(field, side, "not in " + std::to_string(kMinImageSidePx) + " to " + std::to_string(kMaxImageSidePx));
  };
  // Written so that NaN fails, too.
  const auto check_range = [&](std::string_view field, double value, double min, double max) {
    if (value >= min && value <= max) return Status::Ok();
    return refuse(field, value, "not in " + FormatDouble(min) + " to " + FormatDouble(max));
  };

  HAUSTRA_TRY(check_side("width_px", calibration.width_px));
  HAUSTRA_TRY(check_side("height_px", calibration.height_px));
  if (calibration.kind != CameraModelKind::kOcamCalib) {
    // From a half angle of view near 90 degrees to less than a tenth of a degree.
    HAUSTRA_TRY(check_range("fx", calibration.fx, 1.0, 1e7));
    HAUSTRA_TRY(check_range("fy", calibration.fy, 1.0, 1e7));
  }
  HAUSTRA_TRY(check_range("cx", calibration.cx, 0.0, calibration.width_px - 1.0));
  HAUSTRA_TRY(check_range("cy", calibration.cy, 0.0, calibration.height_px - 1.0));
  if (calibration.rate_hz != 0.0) {  // 0: unknown
    HAUSTRA_TRY(check_range("rate_hz", calibration.rate_hz, kMinRateHz, kMaxRateHz));
  }
  HAUSTRA_TRY(check_range("max_half_angle_deg", calibration.max_half_angle_deg, 0.0, 180.0));
  HAUSTRA_TRY(check_range("focal_guess_sigma", calibration.focal_guess_sigma, 0.0, kMaxFocalGuessSigma));
  for (const double coefficient : calibration.coefficients) {
    if (!std::isfinite(coefficient)) return refuse("coefficients", coefficient, "not finite");
  }
  if (calibration.kind == CameraModelKind::kOcamCalib) {
    const auto& [a0, a2, a3, a4, c, d, e, unused] = calibration.coefficients;
    if (!(a0 > 0.0)) {
      return refuse("a0", a0,
                    "not positive; with z forward it is (the MATLAB toolbox looks along -z: negate a0 to a4)");
    }
    if (!(c - d * e > 0.1)) return refuse("c", c, "and [c d; e 1] mirrors or flattens the image");
  }
  return Status::Ok();
}

}  // namespace haustra::capture::internal
