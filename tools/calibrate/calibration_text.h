// An estimated calibration in words and as JSON. reentrant.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tools/calibrate/clip_calibration.h"

namespace haustra {

// What a person must know of a calibration whose focal length is a guess, in a sentence without a stop; else empty.
std::string GuessText(const CameraCalibration& calibration);
// A few lines for a person.
std::string CalibrationText(const ClipCalibration& result);
nlohmann::ordered_json CalibrationJson(const ClipCalibration& result);

}  // namespace haustra
