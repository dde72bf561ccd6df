#include "tools/command/missing_calibration.h"

#include <cstdio>
#include <filesystem>
#include <system_error>

#include "capture/open_sequence.h"
#include "capture/v4l2/v4l2_options.h"

namespace haustra {

Status ApartFromCalibration(const Status& error, const std::string& sequence, const SequenceOptions& options) {
  if (error.code() != StatusCode::kNotFound || !options.calibration_path.empty()) return error;
  if (IsV4l2Spec(sequence)) return error;
  SequenceOptions calibrated = options;
  calibrated.calibration = CameraCalibration{};
  return OpenSequence(sequence, calibrated).status();
}

Status WithCalibrationAdvice(const Status& error, const std::string& sequence, const SequenceOptions& options) {
  if (const Status other = ApartFromCalibration(error, sequence, options); !other.ok()) return other;
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path folder = fs::is_directory(sequence, ignored) ? fs::path(sequence) : fs::path(sequence).parent_path();
  char rate[40] = "";
  if (options.frame_rate_hz > 0.0) std::snprintf(rate, sizeof(rate), " --frame-rate %g", options.frame_rate_hz);
  return Status(error.code(), error.message() + "; 'haustra calibrate " + sequence + rate + " --out " +
                                  (folder / "calib.yaml").string() + "' estimates one");
}

}  // namespace haustra
