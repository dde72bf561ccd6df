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
  // The next frame in line, which was not to be had.
  Stamp Missing() {
    const Stamp stamp{next_index_++, has_first_ ? last_ + period_ : TimePoint{}};
    if (!has_first_) first_ = stamp.timestamp;
    has_first_ = true;
    last_ = stamp.timestamp;
    return stamp;
  }
  Duration video_time() const { return has_first_ ? last_ - first_ + period_ : Duration{0}; }

 private:
  Duration period_;
  bool has_first_ = false;
  std::uint32_t next_index_ = 0;
  TimePoint first_;
  TimePoint last_;
};

}  // namespace haustra
