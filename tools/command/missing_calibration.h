// What to do about a sequence that brings no calibration. thread-bound(caller).
#pragma once

#include <string>

#include "capture/sequence_options.h"
#include "hal/core/status.h"

namespace haustra {

// What is wrong with a sequence, for which OpenSequence has said `error`, when somebody brings the calibration. kOk:
// nothing, only that was missing.
Status ApartFromCalibration(const Status& error, const std::string& sequence, const SequenceOptions& options);

// The same, but where only the calibration is missing: `error`, and the command that estimates one.
Status WithCalibrationAdvice(const Status& error, const std::string& sequence, const SequenceOptions& options);

}  // namespace haustra
