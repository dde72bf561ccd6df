#include "tools/calibrate/calibration_text.h"

#include <cstdio>
#include <nlohmann/json.hpp>

namespace haustra {

using calibration::Intrinsics;
using calibration::IntrinsicVector;

std::string GuessText(const CameraCalibration& calibration) {
  if (!(calibration.focal_guess_sigma > 0.0)) return {};
  char text[128];
  std::snprintf(text, sizeof(text), "focal length guessed: %.0f px +- %.0f %%; shapes may be stretched by that much",
                calibration.fx, 100.0 * calibration.focal_guess_sigma);
  return text;
}

std::string CalibrationText(const ClipCalibration& result) {
  const Intrinsics& value = result.estimate.intrinsics;
  const IntrinsicVector& sigma = result.estimate.sigma;
  const double focal_share = sigma[calibration::kLogFocal];
  char text[1024];
  std::snprintf(text, sizeof(text),
                "  focal length  %.1f px +- %.1f (%.1f %%), r = f (th + k1 th^3 + k2 th^5)\n"
                "  centre        %.1f +- %.1f, %.1f +- %.1f px; the scope's window has its own at %.1f, %.1f\n"
                "  k1, k2        %.4f +- %.4f, %.4f +- %.4f\n"
                "  from          %d of %d windows, %d points, RMS %.2f px, %.0f %% of the scope's window covered\n",
                value.focal_px, value.focal_px * focal_share, 100.0 * focal_share, value.cx, sigma[calibration::kCx],
                value.cy, sigma[calibration::kCy], result.scope.centre_x_px, result.scope.centre_y_px, value.k1,
                sigma[calibration::kK1], value.k2, sigma[calibration::kK2], result.estimate.num_windows,
                result.estimate.num_windows_offered, result.estimate.num_points, result.estimate.rms_px,
                100.0 * result.estimate.coverage);
  return text;
}

nlohmann::ordered_json CalibrationJson(const ClipCalibration& result) {
  const Intrinsics& value = result.estimate.intrinsics;
  const IntrinsicVector& sigma = result.estimate.sigma;
  const auto with_sigma = [](double estimate, double spread) {
    return nlohmann::ordered_json{{"value", estimate}, {"sigma", spread}};
  };
  const Status& verdict = result.estimate.verdict;
  nlohmann::ordered_json json = {{"source", verdict.ok() ? "estimated" : "guessed"}};
  if (!verdict.ok()) {
    json["note"] = GuessText(result.calibration);
    json["reason"] = verdict.message();
  }
  json.update({{"focal_px", with_sigma(value.focal_px, value.focal_px * sigma[calibration::kLogFocal])},
               {"cx", with_sigma(value.cx, sigma[calibration::kCx])},
               {"cy", with_sigma(value.cy, sigma[calibration::kCy])},
               {"k1", with_sigma(value.k1, sigma[calibration::kK1])},
               {"k2", with_sigma(value.k2, sigma[calibration::kK2])},
               {"windows", result.estimate.num_windows},
               {"points", result.estimate.num_points},
               {"rms_px", result.estimate.rms_px},
               {"coverage", result.estimate.coverage}});
  return json;
}

}  // namespace haustra
