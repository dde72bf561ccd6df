// The calibration of a camera from a clip of its own: reads the frames, lets engine/calibration follow features through
// short windows and estimate. thread-bound(the caller).
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "capture/sequence_options.h"
#include "engine/calibration/scope_window.h"
#include "engine/calibration/self_calibration.h"
#include "engine/calibration/window_collector.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra {

struct ClipCalibrationRequest {
  std::string sequence;         // as for OpenSequence; not a live camera
  SequenceOptions options;      // part, mask, deinterlace; its calibrations and halve are not used
  std::string device = "auto";  // as the command line has it; "cpu" or "cuda" when it is used
  int threads = 0;
  std::uint64_t seed = 1;
  std::function<void(std::uint32_t frame_index, std::uint32_t num_frames)> on_frame;  // may be empty
};

struct ClipCalibration {
  CameraCalibration calibration;  // Kannala-Brandt, of the frames as they are stored; says whether it is a guess
  // Its verdict says whether the clip holds it, or what the clip lacks.
  calibration::CalibrationEstimate estimate;
  calibration::ScopeWindow scope;
  calibration::CollectorCounters counters;
  int width_px = 0, height_px = 0;
};

// Errors of OpenSequence and CreateVisionDevice.
Result<ClipCalibration> CalibrateFromClip(const ClipCalibrationRequest& request);

}  // namespace haustra
