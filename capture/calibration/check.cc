#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "capture/calibration/formats.h"
#include "capture/number.h"

namespace haustra::capture::internal {
namespace {

constexpr double kMaxFocalPx = 1e7;

// A coefficient of the distortion: alone it moves a pixel by itself times a power of the pixel's distance from the
// centre, as a share of that distance.
struct Term {
  std::string_view name;
  std::size_t index;
  int power;
};
constexpr Term kPinholeTerms[] = {{"k1", 0, 2}, {"k2", 1, 4}, {"p1", 2, 1}, {"p2", 3, 1}, {"k3", 4, 6}};
constexpr Term kKannalaBrandtTerms[] = {{"k1", 0, 2}, {"k2", 1, 4}, {"k3", 2, 6}, {"k4", 3, 8}};
constexpr Term kOcamCalibTerms[] = {{"a2", 1, 2}, {"a3", 2, 3}, {"a4", 3, 4}};
// At the corner of the picture that is farthest from the centre. A wide lens whose window is small in the picture
// reaches hundreds there, in the dark around it.
constexpr double kMaxTerm = 1e4;
// Of OCamCalib's [c d; e 1], which is near [1 0; 0 1].
constexpr double kMaxAffine = 10.0;

}  // namespace

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
    HAUSTRA_TRY(check_range("fx", calibration.fx, 1.0, kMaxFocalPx));
    HAUSTRA_TRY(check_range("fy", calibration.fy, 1.0, kMaxFocalPx));
  }
  HAUSTRA_TRY(check_range("cx", calibration.cx, 0.0, calibration.width_px - 1.0));
  HAUSTRA_TRY(check_range("cy", calibration.cy, 0.0, calibration.height_px - 1.0));
  if (calibration.rate_hz != 0.0) {  // 0: unknown
    HAUSTRA_TRY(check_range("rate_hz", calibration.rate_hz, kMinRateHz, kMaxRateHz));
  }
  HAUSTRA_TRY(check_range("max_half_angle_deg", calibration.max_half_angle_deg, 0.0, 180.0));
  HAUSTRA_TRY(check_range("focal_guess_sigma", calibration.focal_guess_sigma, 0.0, kMaxFocalGuessSigma));
  const double corner_x_px = std::max(calibration.cx, calibration.width_px - 1 - calibration.cx);
  const double corner_y_px = std::max(calibration.cy, calibration.height_px - 1 - calibration.cy);
  const auto check_terms = [&](std::span<const Term> terms, double corner, double at_centre) {
    for (const Term& term : terms) {
      const double value = calibration.coefficients[term.index];
      if (!(std::abs(value) * std::pow(corner, term.power) <= kMaxTerm * at_centre)) {
        return refuse(term.name, value, "which moves a corner of the picture farther than any lens does");
      }
    }
    return Status::Ok();
  };
  switch (calibration.kind) {
    case CameraModelKind::kPinhole:
    case CameraModelKind::kKannalaBrandt: {
      const double corner = std::hypot(corner_x_px / calibration.fx, corner_y_px / calibration.fy);
      if (calibration.kind == CameraModelKind::kPinhole) return check_terms(kPinholeTerms, corner, 1.0);
      return check_terms(kKannalaBrandtTerms, corner, 1.0);
    }
    case CameraModelKind::kOcamCalib: break;
  }
  const auto& [a0, a2, a3, a4, c, d, e, unused] = calibration.coefficients;
  if (!(a0 > 0.0)) {
    return refuse("a0", a0, "not positive; with z forward it is (the MATLAB toolbox looks along -z: negate a0 to a4)");
  }
  HAUSTRA_TRY(check_range("a0", a0, 0.0, kMaxFocalPx));
  HAUSTRA_TRY(check_terms(kOcamCalibTerms, std::hypot(corner_x_px, corner_y_px), a0));
  for (const auto& [name, value] : {std::pair{"c", c}, std::pair{"d", d}, std::pair{"e", e}}) {
    HAUSTRA_TRY(check_range(name, value, -kMaxAffine, kMaxAffine));
  }
  if (!(c - d * e > 0.1)) return refuse("c", c, "and [c d; e 1] mirrors or flattens the image");
  return Status::Ok();
}

}  // namespace haustra::capture::internal
