// What to do about a sequence that brings no calibration. thread-bound(caller).
#pragma once

#include <string>

#include "capture/sequence_options.h"
#include "hal/core/status.h"

namespace haustra {

// Whether `error` of OpenSequence goes away when somebody brings the calibration.
bool LacksOnlyCalibration(const Status& error, const std::string& sequence, const SequenceOptions& options);

// `error`, and where only the calibration is missing, the command that estimates one.
Status WithCalibrationAdvice(const Status& error, const std::string& sequence, const SequenceOptions& options);

}  // namespace haustra
