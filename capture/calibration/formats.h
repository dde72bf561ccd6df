// One reader a format, each on a map or an XML text that is already parsed. reentrant; kInvalidArgument throughout,
// with file, line and key.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <string_view>

#include "capture/calibration/yaml_map.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra::capture::internal {

Result<CameraCalibration> ReadSettingsFormat(const YamlMap& file);
Result<CameraCalibration> ReadHaustraFormat(const YamlMap& file);
Result<CameraCalibration> ReadOpencvFormat(const YamlMap& file);
Result<CameraCalibration> ReadKalibrFormat(const YamlMap& file);
Result<CameraCalibration> ReadEurocFormat(const YamlMap& file);
Result<CameraCalibration> ReadCalibuFormat(const std::string& path, std::string_view text);

// Row-major 4x4 `T_BS` of an EuRoC sensor.yaml: body_from_cam.
Result<std::array<double, 16>> ReadEurocBodyFromCam(const YamlMap& file);

inline constexpr int kMinImageSidePx = 16;
inline constexpr int kMaxImageSidePx = 16384;
inline constexpr double kMinRateHz = 0.001;  // less may be no time from frame to frame that 64 bits of ns hold
inline constexpr double kMaxRateHz = 10000.0;
inline constexpr double kMaxFocalGuessSigma = 1.0;  // farther off is no guess

// What holds for every calibration: sizes, focal lengths, principal point inside the image, coefficients that move its
// corners no farther than any lens does. `where` turns a field name (width_px, fx, k1, ...) into the place that
// the message begins with.
Status CheckCalibration(const CameraCalibration& calibration,
                        const std::function<std::string(std::string_view field)>& where);

// Of the fields of a pinhole or Kannala-Brandt camera: k1, p1, ...
inline bool IsDistortion(std::string_view field) { return field.starts_with('k') || field.starts_with('p'); }

// The smallest set of coefficients of each model, in the order of hal/camera_calibration.h.
inline constexpr int kNumPinholeCoefficients = 5;
inline constexpr int kNumKannalaBrandtCoefficients = 4;
inline constexpr int kNumOcamCalibCoefficients = 7;

}  // namespace haustra::capture::internal
