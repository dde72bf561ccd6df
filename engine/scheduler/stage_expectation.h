// What a stage is expected to take at worst: a high quantile of its last durations, in fixed memory. A stage that is
// refused for it is forgotten after a while, so that it is tried again; after a try that was as slow, later.
// thread-bound(its owner), rt-safe. Add sorts a copy of the window: about a microsecond.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "hal/core/time.h"

namespace haustra {

class StageExpectation {
 public:
  static constexpr int kWindow = 64;
  static constexpr int kMaxPatience = 16;  // times retry_after

  // quantile in (0, 1], nearest rank. retry_after > 0: of refusals, after which the stage is tried again.
  StageExpectation(double quantile, Duration retry_after) : quantile_(quantile), retry_after_(retry_after) {}

  void Add(Duration duration) {
    if (is_forgotten()) {
      // What was measured before the stage was left out says nothing of now.
      patience_ = 10 * duration >= 9 * value_ ? std::min(2 * patience_, kMaxPatience) : 1;
      num_ = next_ = 0;
    }
    refused_for_ = Duration{0};
    window_[static_cast<std::size_t>(next_)] = duration;
    next_ = (next_ + 1) % kWindow;
    num_ = std::min(num_ + 1, kWindow);
    std::array<Duration, kWindow> sorted = window_;
    const int rank = std::clamp(static_cast<int>(std::ceil(quantile_ * num_)), 1, num_) - 1;
    std::nth_element(sorted.begin(), sorted.begin() + rank, sorted.begin() + num_);
    value_ = sorted[static_cast<std::size_t>(rank)];
  }

  // The stage was left out of a frame because it would have taken too long. `period`: until the next frame.
  void Refused(Duration period) { refused_for_ += period; }

  // Zero when it is not known: then the stage is tried.
  Duration value() const { return is_forgotten() ? Duration{0} : value_; }

 private:
  bool is_forgotten() const { return refused_for_ >= patience_ * retry_after_; }

  double quantile_;
  Duration retry_after_;
  std::array<Duration, kWindow> window_{};
  int num_ = 0;
  int next_ = 0;
  Duration refused_for_{0};  // in a row
  int patience_ = 1;
  Duration value_{0};
};

}  // namespace haustra
