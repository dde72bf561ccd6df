// Frames in time order, from a camera, a folder or a recording.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "hal/core/time.h"
#include "hal/core/views.h"

namespace haustra {

struct Frame {
  std::uint32_t index = 0;  // position in the source, counted after decimation; gaps are frames that were lost
  TimePoint timestamp;      // capture time, strictly increasing
  ImageView image;          // valid until the next call of Next() on its source
  // The picture was interlaced; it shows one of its two fields, and the rows of the other one are made from that.
  bool shows_one_field = false;
  // What the camera or the recording says, where `timestamp` is another one in its place, as that would not do.
  std::optional<TimePoint> refused_stamp = std::nullopt;
};

// "frame_000042.png": the picture of a frame of a recording, counted from 0. FFmpeg extracts all under these names:
// ffmpeg -i VIDEO -vsync passthrough -start_number 0 frame_%06d.png
std::string NumberedFrameName(std::uint32_t number);

// thread-bound(the reader).
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // What the frames look like; constant over the life of the source.
  virtual const CameraCalibration& calibration() const = 0;
  // Number of frames, or 0 when it is not known (live camera). Of a recording it is what its container lets expect.
  virtual std::uint32_t num_frames() const = 0;
  // Whether a camera takes the frames as they are read: then their time stamps are of the machine's monotonic clock,
  // and the age of a frame is known.
  virtual bool is_live() const { return false; }
  // How the pixels of the frames lie, where that is known before the first one comes.
  virtual std::optional<PixelFormat> pixel_format() const { return std::nullopt; }
  // 255 where the scope's window shows the scene, 0 elsewhere; empty view when there is no static mask.
  virtual ImageView static_mask() const = 0;

  // The file that holds the picture of a frame, relative to the deepest folder that holds all of them; for frames that
  // are no files, NumberedFrameName of their place in what was recorded.
  virtual std::string FrameName(std::uint32_t frame_index) const { return NumberedFrameName(frame_index); }

  // thread-safe. While Next brings a device back that had gone, or begins its stream: when the newest call of its
  // driver began. One that is slow is no hang yet, but one that never returns is. Nothing at all other times.
  virtual std::optional<TimePoint> recovering_since() const { return std::nullopt; }

  // The next frame. kNotFound: the sequence is over. kDataLoss: this frame is damaged (the message says where); the
  // next call goes on after it. kDeadlineExceeded, kUnavailable: none came, device gone.
  virtual Result<Frame> Next(TimePoint deadline) = 0;
};

}  // namespace haustra
