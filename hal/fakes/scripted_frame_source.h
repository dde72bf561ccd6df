// A frame source that follows a script: marked pictures (frame_tag.h), gaps, damaged frames, a device that goes away.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/fakes/manual_clock.h"
#include "hal/frame_source.h"

namespace haustra {

// thread-bound(the reader); the script is written before the first Next.
class ScriptedFrameSource final : public FrameSource {
 public:
  // Pictures have the calibration's size, at least kFrameTagBytes wide. With a clock the source is live: frames become
  // due at their time stamps; Next moves the clock to the frame that it returns, or to the deadline when that is
  // earlier.
  explicit ScriptedFrameSource(const CameraCalibration& calibration, ManualClock* clock = nullptr);

  // A frame; the time stamp is the caller's, so that duplicate and backward ones can be scripted too.
  void AddFrame(TimePoint timestamp, std::optional<TimePoint> refused_stamp = std::nullopt);
  // Frames that never come: the index goes on, nothing is returned.
  void AddGap(std::uint32_t num_frames);
  // The next call returns this instead of a frame; one index passes (kDataLoss: a damaged frame).
  void AddFailure(StatusCode code, std::string message);
  // `num_frames` frames at equal distances, the first at `start`.
  void AddFrames(std::uint32_t num_frames, TimePoint start, Duration period);

  void SetStaticMask(std::vector<std::uint8_t> mask) { mask_ = std::move(mask); }
  // Live sources do not know how long they will be.
  void SetEndless(bool is_endless) { is_endless_ = is_endless; }

  const CameraCalibration& calibration() const override { return calibration_; }
  std::uint32_t num_frames() const override { return is_endless_ ? 0 : next_index_; }
  bool is_live() const override { return is_endless_; }
  ImageView static_mask() const override;
  Result<Frame> Next(TimePoint deadline) override;

 private:
  struct Entry {
    std::uint32_t index = 0;
    TimePoint timestamp;
    StatusCode code = StatusCode::kOk;
    std::string message;
    std::optional<TimePoint> refused_stamp = std::nullopt;
  };

  CameraCalibration calibration_;
  ManualClock* clock_;
  std::vector<Entry> entries_;
  std::vector<std::uint8_t> pixels_;
  std::vector<std::uint8_t> mask_;
  std::size_t position_ = 0;
  std::uint32_t next_index_ = 0;
  bool is_endless_ = false;
};

}  // namespace haustra
