// Keeps background requests to an accelerator out of the time in which tracking needs it: such a request cannot be
// interrupted, so one that is under way when a frame comes delays that frame. Tracking says when it works and when the
// next frame is due; mapping and merging ask before each request. Tracking never waits here.
//
// A request that fits between now and the next frame goes at once. One that does not waits for the next frame to be
// answered, and goes then, whatever it takes: it waits for one frame at most, so mapping is slowed but never stopped.
// One tracking thread, one other at a time (shared_lane_device.h). rt-safe on tracking's side.
#pragma once

#include <atomic>
#include <cstdint>

#include "engine/scheduler/stage_expectation.h"
#include "hal/clock.h"

namespace haustra {

class BackgroundGate {
 public:
  // How background work waits; a fake moves a clock. Not rt-safe.
  using Sleep = void (*)(void* context, Duration duration);

  BackgroundGate(const Clock& clock, double quantile);
  BackgroundGate(const Clock& clock, double quantile, Sleep sleep, void* context);

  // Tracking thread. next_due: when the next frame is expected (kNoDeadline: never).
  void FrameBegins() { num_frames_.fetch_add(1, std::memory_order_release); }
  void FrameEnds(TimePoint next_due) {
    next_due_ns_.store(next_due.time_since_epoch().count(), std::memory_order_relaxed);
    num_frames_.fetch_add(1, std::memory_order_release);
  }

  // Background work: before a request, and with what it took, after it.
  void Enter();
  void Leave(Duration duration) { expected_.Add(duration); }

  // Requests that had to wait, and for how long together. Read when no request is under way.
  std::uint64_t num_waits() const { return num_waits_; }
  Duration waited() const { return waited_; }

 private:
  bool IsOpen(std::uint64_t num_frames, TimePoint now) const;

  const Clock& clock_;
  const Sleep sleep_;
  void* const sleep_context_;
  std::atomic<std::uint64_t> num_frames_{0};  // begun and ended: odd while tracking works
  std::atomic<std::int64_t> next_due_ns_{kNoDeadline.time_since_epoch().count()};
  StageExpectation expected_;
  std::uint64_t num_waits_ = 0;
  Duration waited_{0};
};

}  // namespace haustra
