// How long a slice of a join may last, and the join itself. Default: in one piece, without a clock (sequential mode).
#pragma once

#include <functional>

#include "hal/clock.h"
#include "hal/core/time.h"

namespace haustra {

struct JoinLimits {
  const Clock* clock = nullptr;       // needed with either
  TimePoint slice_end = kNoDeadline;  // then keyframes have their turn
  TimePoint deadline = kNoDeadline;   // then the join ends as well as it can

  bool is_slice_over() const { return slice_end != kNoDeadline && clock->Now() >= slice_end; }
  bool is_over() const { return deadline != kNoDeadline && clock->Now() >= deadline; }
  // What is stopped now is not gone on with.
  bool is_last() const { return slice_end == kNoDeadline || is_over(); }
};

// Tells a solver when to stop. The end of a slice stops none before its first step, so that every slice gains
// something, however short it is.
class JoinStopper {
 public:
  explicit JoinStopper(const JoinLimits& limits) : limits_(limits) {}

  std::function<bool()> function() {
    return [this] { return has_stopped_ = limits_.is_over() || (num_asked_++ > 0 && limits_.is_slice_over()); };
  }
  bool has_stopped() const { return has_stopped_; }

 private:
  const JoinLimits& limits_;
  int num_asked_ = 0;
  bool has_stopped_ = false;
};

}  // namespace haustra
