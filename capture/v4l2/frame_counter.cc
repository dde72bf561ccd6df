#include "capture/v4l2/frame_counter.h"

#include <algorithm>
#include <cmath>

namespace haustra::capture::internal {
namespace {

// No camera of a tower is faster.
constexpr double kFastestHz = 120.0;

}  // namespace

void FrameCounter::Restart(double rate_hz, double max_rate_hz, std::uint32_t every_nth) {
  rate_hz_ = rate_hz;
  // A camera that is a little too fast for its nominal rate keeps all its pictures.
  constexpr double kTolerance = 1.01;
  const double most_hz = max_rate_hz / every_nth;
  if (rate_hz <= 0.0) {
    frames_per_picture_ = 1.0 / every_nth;
  } else {
    frames_per_picture_ = rate_hz > most_hz * kTolerance ? most_hz / rate_hz : 1.0;
  }
  has_previous_ = false;
  position_ = 0;
  first_index_ = next_free_;
}

FrameCounter::Place FrameCounter::Count(std::uint32_t sequence, TimePoint timestamp) {
  Place place;
  if (has_previous_) {
    std::uint32_t step = sequence - sequence_;
    if (step == 0 || step > (1u << 31)) step = 1;
    // No more can have been lost than there was time for: a damaged count must not run away with the numbers.
    if (step > 1) {
      const double most_hz = rate_hz_ > 0.0 ? rate_hz_ : kFastestHz;
      const double seconds = std::max(0.0, ToSeconds(timestamp - timestamp_));
      step = static_cast<std::uint32_t>(std::min<double>(step, std::ceil(seconds * most_hz) + 1.0));
    }
    place.num_lost = step - 1;
    position_ += step;
  }
  has_previous_ = true;
  sequence_ = sequence;
  timestamp_ = timestamp;
  place.index = IndexOf(position_);
  place.is_taken = place.index < next_free_;
  place.is_last_chance = IndexOf(position_ + 1) != place.index;
  return place;
}

std::uint32_t FrameCounter::IndexOf(std::uint64_t position) const {
  // The small term keeps 25/50 and its like from falling short of a whole number.
  return first_index_ +
         static_cast<std::uint32_t>(std::floor(static_cast<double>(position) * frames_per_picture_ + 1e-9));
}

}  // namespace haustra::capture::internal
