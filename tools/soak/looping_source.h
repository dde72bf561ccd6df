// A sequence played over and over for a given time of video: forwards, backwards, forwards, so that the camera never
// jumps; or forwards only, where every end is a jump and the scope has to find itself again. Frame numbers and time run
// on. thread-bound(the reader).
#pragma once

#include <functional>
#include <memory>

#include "hal/frame_source.h"

namespace haustra {

class LoopingSource final : public FrameSource {
 public:
  // Opens the sequence from its beginning, in the given direction.
  using Opener = std::function<Result<std::unique_ptr<FrameSource>>(bool reversed)>;

  // kInvalidArgument: the sequence has fewer than two frames that can be read. Errors of `open`.
  static Result<std::unique_ptr<LoopingSource>> Create(Opener open, bool back_and_forth, Duration video_time);

  const CameraCalibration& calibration() const override { return current_->calibration(); }
  std::uint32_t num_frames() const override { return 0; }
  ImageView static_mask() const override { return mask_source_->static_mask(); }
  // kNotFound when the time is over.
  Result<Frame> Next(TimePoint deadline) override;

  int num_loops() const { return num_loops_; }

 private:
  LoopingSource(Opener open, bool back_and_forth, Duration video_time)
      : open_(std::move(open)), back_and_forth_(back_and_forth), video_time_(video_time) {}
  Status Reopen();

  Opener open_;
  const bool back_and_forth_;
  const Duration video_time_;
  std::unique_ptr<FrameSource> mask_source_;  // the first one: its mask is lent out
  std::unique_ptr<FrameSource> later_;
  FrameSource* current_ = nullptr;
  bool is_reversed_ = false;
  bool is_fresh_ = true;  // nothing was read from the current source yet
  int num_loops_ = 0;
  std::uint32_t next_index_ = 0;
  std::uint32_t frames_of_loop_ = 0;
  TimePoint first_;
  TimePoint last_;
  Duration offset_{0};
  Duration period_{0};
  bool has_first_ = false;
};

}  // namespace haustra
