// Whether the threads of a session live, from when each was last heard of. A worker whose tracking hangs is replaced
// although its other threads are well.
#pragma once

#include <optional>
#include <string>

#include "hal/core/time.h"
#include "platform/daemon/daemon_config.h"
#include "platform/realtime/heartbeat.h"

namespace haustra {

// When a thread was last heard of. `beat` has one beat of the start; until the thread adds its own, all threads take
// and lock their memory. That is work, for `work_limit` at most.
TimePoint SignOfThread(const Heartbeat& beat, TimePoint now, Duration work_limit);

// When capture was last heard of: `last`, but for a source that brings its device back (FrameSource::recovering_since).
// That is work while no call of the driver takes longer than `work_limit`.
TimePoint SignOfCapture(TimePoint last, std::optional<TimePoint> recovering_since, TimePoint now, Duration work_limit);

struct SignsOfLife {
  TimePoint tracking;  // beats many times a second, with or without frames
  TimePoint capture;   // whenever the source answered (a frame, or that there is none), and while a frame is not due or
                       // the source brings its device back
  TimePoint mapping;   // between two steps
  TimePoint merging;   // when it owed mapping no answer
};

// Empty: all are well. Else which thread hangs, and since when: "tracking thread hangs for 1.2 s". reentrant.
std::string FindHang(const SignsOfLife& signs, TimePoint now, const WatchdogConfig& limits);

}  // namespace haustra
