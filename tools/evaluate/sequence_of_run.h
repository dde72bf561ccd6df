// The sequence that a run was made from, read again for its pictures. reentrant.
#pragma once

#include <cstdint>
#include <string>

#include "capture/sequence_options.h"
#include "hal/core/status.h"
#include "hal/core/time.h"
#include "tools/evaluate/run_output.h"

namespace haustra::evaluate {

// The part that the run has read, so that frames have the numbers of the run. No calibration is looked for, which the
// run may have had from elsewhere, or guessed. Image files without times come at the rate of the run.
SequenceOptions OptionsForPictures(const RunOutput& run);

// kInvalidArgument: the run gives the frame another time, so `sequence` is another one. Nothing is known of frames that
// the run has not answered.
Status CheckIsOfRun(const RunOutput& run, std::int64_t frame_idx, TimePoint timestamp, const std::string& sequence);

}  // namespace haustra::evaluate
