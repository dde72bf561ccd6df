// Some frames of a sequence, held in memory and played there and back again for ever: so the picture never jumps, and
// reading and decoding files is no part of what is measured. thread-bound(the reader).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "hal/frame_source.h"

namespace haustra {

class LoopedSource final : public FrameSource {
 public:
  // The first `max_frames` readable frames of the source. kFailedPrecondition: fewer than two. Errors of the source.
  static Result<std::unique_ptr<LoopedSource>> Load(FrameSource& source, int max_frames);

  std::size_t num_loaded() const { return frames_.size(); }
  std::size_t num_bytes() const { return num_bytes_; }

  const CameraCalibration& calibration() const override { return calibration_; }
  std::uint32_t num_frames() const override { return 0; }
  std::optional<PixelFormat> pixel_format() const override { return frames_.front().view.format; }
  ImageView static_mask() const override;
  // The next one at once; time stamps at the camera's rate from zero, indices from 0.
  Result<Frame> Next(TimePoint deadline) override;

 private:
  struct Picture {
    std::vector<std::uint8_t> pixels;
    ImageView view;
  };
  LoopedSource() = default;

  CameraCalibration calibration_;
  Duration period_{0};
  std::vector<Picture> frames_;
  Picture mask_;
  std::size_t num_bytes_ = 0;
  std::uint32_t next_ = 0;
};

}  // namespace haustra
