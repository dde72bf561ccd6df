// Drives an engine over a frame source, in one of the two ways of running (system.md 11), and tells an observer about
// every frame. The same engine classes serve both; only the threads differ.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "engine/engine.h"
#include "hal/clock.h"
#include "hal/frame_source.h"

namespace haustra {

struct FrameOutcome {
  FrameResult result;
  Duration processing{0};   // time spent on the frame, tracking and (sequential mode) mapping
  Duration latency{0};      // real time: from the moment the frame was due to the answer; sequential: processing
  bool is_dropped = false;  // a newer frame came before this one was looked at
  bool is_damaged = false;  // the frame could not be read
};

// Called on the thread that runs the session, in frame order, never on the tracking thread.
class SessionObserver {
 public:
  virtual ~SessionObserver() = default;
  virtual void OnFrame(const FrameOutcome& outcome) = 0;
  virtual void OnMapEvent(const MapEvent& event) = 0;
  // A frame that was answered before its map stood has a pose now.
  virtual void OnLatePose(const LatePose& pose) = 0;
  // A frame that could not be read; the session goes on. `message` names the file.
  virtual void OnDamagedFrame(std::uint32_t frame_index, const std::string& message) = 0;
};

struct SessionSummary {
  Duration wall_time{0};
  Duration video_time{0};  // from the first to the last frame, one period added
};

// Every frame, tracking and mapping in turn on the calling thread; repeats to the bit. Stops early, with Ok, when
// `stop` becomes true. Errors of the source end the session with its status; what was mapped stays in the engine.
Result<SessionSummary> RunSequential(FrameSource& source, Engine& engine, const Clock& clock, SessionObserver& observer,
                                     const std::atomic<bool>& stop);

// Frames become due at their time stamps divided by `rate` (> 0; 1: the camera's own pace), each is dropped when a
// newer one is due before tracking comes to it. Capture, tracking and mapping run on threads of their own, the observer
// on the calling one. A source slower than its own rate delays the frames' due times: reading is not what is measured.
Result<SessionSummary> RunRealTime(FrameSource& source, Engine& engine, const Clock& clock, double rate,
                                   SessionObserver& observer, const std::atomic<bool>& stop);

}  // namespace haustra
