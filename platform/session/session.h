// Drives an engine over a frame source, in one of the two ways of running, and tells an observer about
// every frame. The same engine classes serve both; only the threads differ.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "engine/engine.h"
#include "hal/camera_calibration.h"
#include "hal/clock.h"
#include "hal/core/memory_plan.h"
#include "hal/frame_source.h"
#include "hal/realtime_config.h"
#include "platform/realtime/heartbeat.h"
#include "platform/realtime/realtime_report.h"
#include "platform/realtime/thread_system.h"
#include "platform/session/thread_use.h"
#include "platform/session/watched_vision_device.h"

namespace haustra {

struct FrameOutcome {
  FrameResult result;
  Duration processing{0};        // time spent on the frame, tracking and (sequential mode) mapping
  Duration tracking{0};          // of it, the time in tracking alone
  Duration latency{0};           // real time: from `due` to the answer; sequential: processing
  ThreadUse use;                 // of the tracking thread, while it worked on the frame
  bool is_dropped = false;       // a newer frame came before this one was looked at
  bool is_damaged = false;       // the frame could not be read
  bool shows_one_field = false;  // as Frame says
  // Real time only, of a frame that was tracked; times of the session's clock.
  bool is_late = false;  // answered after its deadline
  TimePoint due;  // when it was captured: a camera's own stamp; of a recording, when a camera would have brought it
  TimePoint deadline;
  TimePoint begin;  // of tracking; it ends at due + latency
  TimePoint capture_begin;
  Duration capture{0};  // reading and copying the frame: of a recording before it was due, of a camera since it was due
};

// What one step of mapping or merging took: a keyframe, the search for a lost frame, the recogniser's answer; 0 for a
// stage that did not take place.
struct MappingTimes {
  std::uint32_t frame_index = 0;  // newest frame that was tracked when it was done
  TimePoint start;                // the stages follow each other in this order
  Duration insert{0}, create{0}, fuse{0}, bundle{0}, cull{0}, asking{0}, merge{0}, relocalisation{0};
  Duration recognition{0};  // merging thread, a step of its own
  Duration place{0};        // all that was asked and answered of one keyframe, in the step that heard the outcome

  Duration mapping() const { return insert + create + fuse + bundle + cull; }
  bool is_empty() const { return (mapping() + asking + recognition + place + merge + relocalisation).count() == 0; }
};

// Called on the thread that runs the session, in frame order, never on the tracking thread.
class SessionObserver {
 public:
  virtual ~SessionObserver() = default;
  // Once, before the first frame of a real-time session: what the system granted.
  virtual void OnStart(const RealTimeReport&) {}
  virtual void OnFrame(const FrameOutcome& outcome) = 0;
  virtual void OnMapEvent(const MapEvent& event) = 0;
  // A frame that was answered before its map stood has a pose now.
  virtual void OnLatePose(const LatePose& pose) = 0;
  // Only when the engine was given a clock.
  virtual void OnMapped(const MappingTimes&) {}
  // Asked once, at the start: who counts what the tracking thread must not call; null: nobody does.
  virtual const ThreadWatch* thread_watch() const { return nullptr; }
  // A frame that could not be read; the session goes on. `message` names the file.
  virtual void OnDamagedFrame(std::uint32_t frame_index, const std::string& message) = 0;
};

// What a program does on the session's own threads.
class SessionHooks {
 public:
  virtual ~SessionHooks() = default;
  // Tracking thread, right after the answer. rt-safe.
  virtual void OnTracked(const FrameOutcome&) {}
  // Mapping thread, between two steps and many times a second while there is nothing to do: here the atlas may be read
  // and saved. A new frame waits for no one; the next keyframe waits for this.
  virtual void BetweenMapSteps() {}
  // Real time, on the thread that runs the session: tracking, mapping and merging have ended, and the engine is the
  // hook's. Once, before the session returns, which may take as long as a driver that capture waits for.
  virtual void OnMapsAtRest() {}
};

struct SessionSummary {
  Duration wall_time{0};
  Duration video_time{0};  // from the first to the last frame, one period added
  // Real time: what the observer was too slow to read (RealTimeOptions::max_unread, 0: no ring).
  std::uint64_t max_unread = 0;
  std::uint64_t num_frames_unread = 0;  // reported as dropped
  std::uint64_t num_times_unread = 0;   // MappingTimes
  // Real time with locked memory: of the heap, beyond what was set aside for it.
  std::uint64_t heap_growth_bytes = 0;
};

// Every frame, tracking, mapping and merging in turn on the calling thread; repeats to the bit. Stops early, with Ok,
// when `stop` becomes true. Errors of the source end the session with its status; what was mapped stays in the engine.
Result<SessionSummary> RunSequential(FrameSource& source, Engine& engine, const Clock& clock, SessionObserver& observer,
                                     const std::atomic<bool>& stop);
// The same; `hooks` is told of every frame, and may use the engine when mapping and merging have done what it brought.
Result<SessionSummary> RunSequential(FrameSource& source, Engine& engine, const Clock& clock, SessionObserver& observer,
                                     const std::atomic<bool>& stop, SessionHooks& hooks);

struct RealTimeOptions {
  double rate = 1.0;  // > 0; 1: the camera's own pace. A live camera has no other, whatever stands here
  RealTimeConfig rt;
  // Beats on the tracking thread while the session runs and the vision device answers; may be null. Outlives the
  // session.
  Heartbeat* heartbeat = nullptr;
  // Beats on the capture thread while it waits for the time at which a frame is due: a recording may have a long pause,
  // and the source is not asked meanwhile. May be null. Outlives the session.
  Heartbeat* capture_heartbeat = nullptr;
  SessionHooks* hooks = nullptr;  // may be null; outlives the session
  // The engine's device, when its faults are to end the session; may be null. Outlives the session.
  const WatchedVisionDevice* device = nullptr;
  // Frames, steps of mapping and steps of merging that wait for the observer, of each; further ones are lost, counted.
  std::size_t max_unread = 4096;
  // Null: this machine.
  ThreadSystem* system = nullptr;
};

// What a real-time session takes of the heap before its first frame: three frames of the camera's size in colour,
// between capture and tracking, and rings of what the threads tell the observer. The sequential one takes nothing.
// max_unread as it is by default.
MemoryPlan PlanRealTimeSession(const CameraCalibration& calibration);

// Frames become due at their time stamps divided by `rate`, each is dropped when a newer one is due before tracking
// comes to it. Capture, tracking, mapping and merging run on threads of their own, the observer on the calling one. A
// source slower than its own rate delays the frames' due times: reading is not what is measured. Frames of a live
// camera are due at their time stamps, as long ago as that was: transport and copying are part of what is measured.
//
// Each frame is to be answered within config.scheduler.deadline_ms of its due time (0: within a period of the frames,
// at the session's rate). The stamps of a recording tell its period; more than a second between two frames is a pause,
// and the period stays what it was. `stop`, set by any thread, ends the session within a fraction of a second, or when
// a join that has begun is done (merging.max_milliseconds): what was mapped stays in the engine, and the status is Ok.
// What would only make the maps better is not begun any more. Sessions may follow each other with the same engine and
// source; no frame of an earlier one can be marked. kInvalidArgument: rate. kFailedPrecondition: rt.require is set and
// a privilege is missing. kUnavailable: the watched device is lost or hangs. Errors of the source.
Result<SessionSummary> RunRealTime(FrameSource& source, Engine& engine, const Clock& clock,
                                   const RealTimeOptions& options, SessionObserver& observer,
                                   const std::atomic<bool>& stop);

// With ordinary scheduling.
Result<SessionSummary> RunRealTime(FrameSource& source, Engine& engine, const Clock& clock, double rate,
                                   SessionObserver& observer, const std::atomic<bool>& stop);

}  // namespace haustra
