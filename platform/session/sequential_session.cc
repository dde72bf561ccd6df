#include "platform/session/frame_pacer.h"
#include "platform/session/session.h"
#include "platform/session/timed_map_step.h"

namespace haustra {

Result<SessionSummary> RunSequential(FrameSource& source, Engine& engine, const Clock& clock, SessionObserver& observer,
                                     const std::atomic<bool>& stop) {
  SessionHooks no_hooks;
  return RunSequential(source, engine, clock, observer, stop, no_hooks);
}

Result<SessionSummary> RunSequential(FrameSource& source, Engine& engine, const Clock& clock, SessionObserver& observer,
                                     const std::atomic<bool>& stop, SessionHooks& hooks) {
  SessionSummary summary;
  FrameNumbering numbering(source.calibration().rate_hz);
  engine.BeginSession();
  const TimePoint start = clock.Now();
  while (!stop.load(std::memory_order_relaxed)) {
    const Result<Frame> frame = source.Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) break;
    FrameOutcome outcome;
    if (frame.code() == StatusCode::kDataLoss) {
      const FrameNumbering::Stamp stamp = numbering.Missing();
      observer.OnDamagedFrame(stamp.frame_index, frame.status().message());
      outcome.is_damaged = true;
      outcome.result = engine.SkipDamaged(stamp.frame_index, stamp.timestamp);
      observer.OnFrame(outcome);
      continue;
    }
    if (!frame.ok()) return frame.status();
    numbering.Seen(*frame);
    outcome.shows_one_field = frame->shows_one_field;
    const TimePoint begin = clock.Now();
    const ThreadUseMeter meter(observer.thread_watch());
    outcome.result = engine.Track(*frame, kNoDeadline);
    outcome.use = meter.Read();
    outcome.tracking = clock.Now() - begin;
    hooks.OnTracked(outcome);
    engine.KeepPicture(*frame, outcome.result);
    for (MappingTimes times; TimedMergeStep(engine, clock, &times) ||
                             TimedMapStep(engine, clock, MapWork::kAll, &times) || engine.DepthStep();) {
      times.frame_index = outcome.result.frame_index;
      if (!times.is_empty()) observer.OnMapped(times);
    }
    outcome.processing = outcome.latency = clock.Now() - begin;
    hooks.BetweenMapSteps();
    observer.OnFrame(outcome);
    for (LatePose pose; engine.late_poses().TryPop(&pose);) observer.OnLatePose(pose);
    for (MapEvent event; engine.map_events().TryPop(&event);) observer.OnMapEvent(event);
  }
  summary.wall_time = clock.Now() - start;
  summary.video_time = numbering.video_time();
  return summary;
}

}  // namespace haustra
