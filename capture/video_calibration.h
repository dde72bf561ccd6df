// Finds what goes with a recorded video: its calibration and mask.
#pragma once

#include <string>

#include "capture/sequence_options.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra::capture::internal {

struct VideoCompanions {
  CameraCalibration calibration;
  std::string calibration_path;
  std::string mask_path;  // empty: none
};

// See OpenVideo.
Result<VideoCompanions> FindVideoCompanions(const std::string& video_path, const SequenceOptions& options);

}  // namespace haustra::capture::internal
