// What a caller may ask of any recorded sequence, whatever its layout.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "capture/codec/image_codec.h"
#include "capture/deinterlace.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra {

struct SequenceOptions {
  // The part of the sequence that is read, counted in frames as they are stored, both ends included. last_frame may lie
  // beyond the end.
  std::uint32_t first_frame = 0;
  std::uint32_t last_frame = std::numeric_limits<std::uint32_t>::max();
  // Of that part every n-th frame, beginning with the first; >= 1.
  std::uint32_t every_nth = 1;
  // From the last frame of that part to the first, with time running on: frame k from the end is as late as frame k
  // from the beginning would be if the sequence were played backwards. Image files only.
  bool reversed = false;
  // Pictures that were woven from two fields are shown by the top one, before anything else is done to them.
  DeinterlaceChoice deinterlace = DeinterlaceChoice::kAuto;
  // Halves the frames by averaging 2x2 pixels; calibration and mask follow.
  bool halve = false;
  ChannelChoice channels = ChannelChoice::kAsStored;
  // Of image files whose times nothing states, instead of the rate of the calibration; 0: that one. Refused for what
  // has times of its own.
  double frame_rate_hz = 0.0;
  // Used instead of the calibration that the sequence carries; empty: that one.
  std::string calibration_path = {};
  // Of the stored frames; used instead of any file, which then need not exist. With a width of 0 it takes the size of
  // the frames: for a caller that wants to see the pictures of a camera without a calibration. Not for live cameras.
  std::optional<CameraCalibration> calibration = {};
  // Used instead of the mask that the sequence carries; empty: that one, or none.
  std::string mask_path = {};

  // The frame with this index, counted as it is stored; not when it is read backwards.
  std::int64_t StoredFrame(std::int64_t index) const { return first_frame + index * every_nth; }
  // The other way; nothing: that one is not read.
  std::optional<std::uint32_t> IndexOf(std::uint32_t stored_frame) const;
  // Of the frames that are handed out: halved, and as many a second as are read.
  CameraCalibration CalibrationOfFrames(const CameraCalibration& stored) const;

  // For what states the times of its frames itself: kInvalidArgument when the options state a frame rate.
  Status RefuseFrameRate(const std::string& path) const;

  // kInvalidArgument, naming what is wrong.
  Status Validate() const;
};

}  // namespace haustra
