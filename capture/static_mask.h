// The static mask of a sequence: which pixels show the scene through the scope's window.
#pragma once

#include <string>

#include "capture/image.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra::capture::internal {

// 255 where the file is at least 128, 0 elsewhere; halved with the frames when `halve` is set (see HalveMask). An empty
// path gives an empty image. kInvalidArgument: not the size of the calibration, nothing of it inside, or more of it
// grey than edges are. Errors of ImageReader::Read.
Result<Image> ReadStaticMask(const std::string& path, const CameraCalibration& stored_calibration, bool halve);

}  // namespace haustra::capture::internal
