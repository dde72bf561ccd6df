// Which of a camera's pictures become frames, and how they are numbered. thread-bound(the reader).
#pragma once

#include <cstdint>

#include "hal/core/time.h"

namespace haustra::capture::internal {

// Numbers the pictures of a camera by its own count, and lets through at most `max_rate_hz` of them a second: time is
// divided into places of equal length, frame k is the first picture that comes in place k. So a camera of 50 Hz gives
// every second picture, and when that is lost, the one after it; one of 60 Hz two or three in turn.
class FrameCounter {
 public:
  // Of what max_rate_hz lets through every n-th. rate_hz: the camera's; 0 when it is not known, and then every n-th
  // picture becomes a frame.
  void Restart(double rate_hz, double max_rate_hz, std::uint32_t every_nth);

  struct Place {
    std::uint32_t index = 0;      // of the frame that the picture belongs to
    std::uint32_t num_lost = 0;   // pictures that should have come between the one before and this
    bool is_taken = false;        // there has been a frame with this index
    bool is_last_chance = false;  // the next picture belongs to another frame
  };
  // Each picture, in order, whatever becomes of it. Of a count that stands still or goes back (drivers that do not
  // count, streams that begin anew) it is taken that nothing was lost.
  Place Count(std::uint32_t sequence, TimePoint timestamp);
  // The frame has been given out, or given up.
  void Take(std::uint32_t index) { next_free_ = index + 1; }

 private:
  std::uint32_t IndexOf(std::uint64_t position) const;

  double rate_hz_ = 0.0;
  double frames_per_picture_ = 1.0;
  bool has_previous_ = false;
  std::uint32_t sequence_ = 0;
  TimePoint timestamp_;
  std::uint64_t position_ = 0;     // of the newest picture since the restart
  std::uint32_t first_index_ = 0;  // of the first frame since the restart
  std::uint32_t next_free_ = 0;
};

}  // namespace haustra::capture::internal
