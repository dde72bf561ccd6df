#include "capture/sequence_options.h"

#include <cmath>

namespace haustra {

Status SequenceOptions::Validate() const {
  if (every_nth == 0) return InvalidArgument("every_nth is 0; 1 reads every frame");
  if (last_frame < first_frame) {
    return InvalidArgument("the last frame, " + std::to_string(last_frame) + ", lies before the first, " +
                           std::to_string(first_frame));
  }
  if (!(std::isfinite(frame_rate_hz) && frame_rate_hz >= 0.0)) {
    return InvalidArgument("the frame rate is " + std::to_string(frame_rate_hz) + " Hz; it must not be below 0");
  }
  return Status::Ok();
}

CameraCalibration SequenceOptions::CalibrationOfFrames(const CameraCalibration& stored) const {
  CameraCalibration of_frames = halve ? Halved(stored) : stored;
  of_frames.rate_hz /= every_nth;
  return of_frames;
}

Status SequenceOptions::RefuseFrameRate(const std::string& path) const {
  if (frame_rate_hz == 0.0) return Status::Ok();
  return InvalidArgument(path + ": states the times of its frames; a frame rate is for image files without times");
}

std::optional<std::uint32_t> SequenceOptions::IndexOf(std::uint32_t stored_frame) const {
  if (stored_frame < first_frame || stored_frame > last_frame) return std::nullopt;
  const std::uint32_t distance = stored_frame - first_frame;
  if (distance % every_nth != 0) return std::nullopt;
  return distance / every_nth;
}

}  // namespace haustra
