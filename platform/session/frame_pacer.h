// Bookkeeping of frame numbers and due times of a session. thread-bound(its owner).
#pragma once

#include <cstdint>

#include "hal/core/time.h"
#include "hal/frame_source.h"

namespace haustra {

// Gives numbers and time stamps to frames that the source could not read, from those around them.
class FrameNumbering {
 public:
  struct Stamp {
    std::uint32_t frame_index = 0;
    TimePoint timestamp;
  };

  // rate_hz: nominal, 0 when unknown.
  explicit FrameNumbering(double rate_hz)
      : period_(rate_hz > 0 ? Duration(static_cast<std::int64_t>(1e9 / rate_hz)) : std::chrono::milliseconds(40)) {}

  void Seen(const Frame& frame) {
    if (!has_first_) first_ = frame.timestamp;
    has_first_ = true;
    next_index_ = frame.index + 1;
    last_ = frame.timestamp;
  }
  // The next frame in line, which was not to be had. Before the first that was, nothing is known of the time: zero.
  Stamp Missing() {
    if (!has_first_) return {next_index_++, TimePoint{}};
    last_ += period_;
    return {next_index_++, last_};
  }
  // One past the last frame that was seen or missing.
  std::uint32_t end_index() const { return next_index_; }
  // When the frame with that index is to be expected; zero when none was seen.
  TimePoint end_time() const { return has_first_ ? last_ + period_ : TimePoint{}; }
  // From the first frame that was seen; zero when none was.
  Duration video_time() const { return has_first_ ? last_ - first_ + period_ : Duration{0}; }

 private:
  Duration period_;
  bool has_first_ = false;
  std::uint32_t next_index_ = 0;
  TimePoint first_;
  TimePoint last_;
};

}  // namespace haustra
