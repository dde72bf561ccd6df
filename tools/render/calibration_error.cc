#include "tools/render/calibration_error.h"

#include <array>
#include <charconv>
#include <cmath>
#include <string>

#include "tools/render/out_of_range.h"

namespace haustra::render {

Status CalibrationError::Validate(int width_px) const {
  if (!(std::abs(focal_percent) <= 20.0))
    return OutOfRange("calibration error: focal length", focal_percent, "[-20, 20] %");
  const double reach = 0.1 * width_px;
  const std::string range = "[-" + NumberText(reach) + ", " + NumberText(reach) + "] px";
  if (!(std::abs(cx_px) <= reach)) return OutOfRange("calibration error: cx", cx_px, range);
  if (!(std::abs(cy_px) <= reach)) return OutOfRange("calibration error: cy", cy_px, range);
  if (!(std::abs(k1) <= 0.1)) return OutOfRange("calibration error: k1", k1, "[-0.1, 0.1]");
  return Status::Ok();
}

Result<CalibrationError> ParseCalibrationError(std::string_view text) {
  std::array<double, 4> values{};
  std::string_view rest = text;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t comma = rest.find(',');
    const std::string_view part = rest.substr(0, comma);
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), values[i]);
    const bool is_number = error == std::errc() && end == part.data() + part.size() && std::isfinite(values[i]);
    const bool is_last = comma == std::string_view::npos;
    if (!is_number || (!is_last && i + 1 == values.size())) break;
    if (is_last) return CalibrationError{values[0], values[1], values[2], values[3]};
    rest.remove_prefix(comma + 1);
  }
  return InvalidArgument("calibration error '" + std::string(text) + "' is not F[,CX,CY,K1], like 2 or 2,-3,1.5,0.01");
}

CameraCalibration Misjudged(const CameraCalibration& truth, const CalibrationError& error) {
  CameraCalibration written = truth;
  written.fx *= 1.0 + error.focal_percent / 100.0;
  written.fy *= 1.0 + error.focal_percent / 100.0;
  written.cx += error.cx_px;
  written.cy += error.cy_px;
  written.coefficients[0] += error.k1;
  return written;
}

}  // namespace haustra::render
