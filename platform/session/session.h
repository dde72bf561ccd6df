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
  Duration tracking{0};     // of it, the time in tracking alone
  Duration latency{0};      // real time: from the moment the frame was due to the answer; sequential: processing
  bool is_dropped = false;  // a newer frame came before this one was looked at
  bool is_damaged = false;  // the frame could not be read
};

// What the mapper spent on one keyframe, or on looking for a lost frame; 0 for a stage that did not take place.
struct MappingTimes {
  std::uint32_t frame_index = 0;  // newest frame that was tracked when it was done
  Duration insert{0}, create{0}, fuse{0}, bundle{0}, cull{0}, place{0}, merge{0}, relocalisation{0};

  Duration mapping() const { return insert + create + fuse + bundle + cull; }
  bool is_empty() const { return (mapping() + place + merge + relocalisation).count() == 0; }
};

// Called on the thread that runs the session, in frame order, never on the tracking thread.
class SessionObserver {
 public:
  virtual ~SessionObserver() = default;
  virtual void OnFrame(const FrameOutcome& outcome) = 0;
  virtual void OnMapEvent(const MapEvent& event) = 0;
  // A frame that was answered before its map stood has a pose now.
  virtual void OnLatePose(const LatePose& pose) = 0;
  // Only when the engine was given a clock.
  virtual void OnMapped(const MappingTimes&) {}
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
