#include <algorithm>
#include <latch>
#include <optional>
#include <thread>
#include <vector>

#include "hal/core/mailbox.h"
#include "hal/core/spsc_ring.h"
#include "platform/realtime/realtime_threads.h"
#include "platform/realtime/wake_signal.h"
#include "platform/session/frame_pacer.h"
#include "platform/session/session.h"
#include "platform/session/thread_name.h"
#include "platform/session/timed_map_step.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

// A thread that waits looks around after it: end of the session, heartbeat of capture.
constexpr Duration kLongestWait = milliseconds(100);
// After a stop; a source that answers no later than it should is done by then.
constexpr Duration kPatienceWithCapture = 5 * kLongestWait;
// From one frame of a recording to the next, by its stamps; a longer time is a pause and says nothing of the period.
constexpr Duration kLongestPeriod = std::chrono::seconds(1);

// A frame on its way from capture to tracking, with its pixels: three of these exist (mailbox).
struct FrameSlot {
  std::vector<std::uint8_t> pixels;
  Frame frame;
  TimePoint due;
  TimePoint handed_over;
  TimePoint capture_begin;
  Duration capture{0};
  Duration period{0};          // until the next one is due
  std::uint64_t sequence = 0;  // counts published frames from 1
  bool is_last = false;        // no frame: the source is over
};

std::size_t FrameBytes(const CameraCalibration& camera) {
  constexpr std::size_t kBytesPerPixel = 3;
  return kBytesPerPixel * static_cast<std::size_t>(camera.width_px) * static_cast<std::size_t>(camera.height_px);
}

struct DamageNote {
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  std::string message;
};

struct Damaged {
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
};

// What the observer has not read yet; a full ring makes the reader of the source wait.
constexpr std::size_t kMaxDamageNotes = 256;

// State shared by the threads of one session.
class RealTimeSession {
 public:
  RealTimeSession(FrameSource& source, Engine& engine, const Clock& clock, const RealTimeOptions& options)
      : source_(source),
        engine_(engine),
        clock_(clock),
        is_live_(source.is_live()),
        rate_(is_live_ ? 1.0 : options.rate),
        period_(PeriodOf(source.calibration().rate_hz, rate_)),
        deadline_ms_(engine.config().scheduler.deadline_ms),
        heartbeat_(options.heartbeat),
        capture_heartbeat_(options.capture_heartbeat),
        hooks_(options.hooks),
        device_(options.device),
        requires_realtime_(options.rt.enabled && options.rt.require),
        frames_(EmptySlot(source.calibration())),
        outcomes_(options.max_unread),
        mapping_times_(options.max_unread),
        merging_times_(options.max_unread),
        damage_(kMaxDamageNotes) {
    engine_.BeginSession();
  }

  // `threads` is made when all the memory of session and engine has been taken.
  Result<SessionSummary> Run(RealTimeThreads& threads, SessionObserver& observer, const std::atomic<bool>& stop) {
    const TimePoint start = clock_.Now();
    thread_watch_ = observer.thread_watch();
    // Each thread applies its settings; none begins before all were looked at.
    std::latch applied(4);
    std::latch decided(1);
    bool may_begin = false;
    const auto launch = [&](SessionThread thread, auto loop) {
      return std::thread([&, thread, loop] {
        threads.Apply(thread);
        if (thread == SessionThread::kTracking) served_ = engine_.ServeThisThread();
        applied.count_down();
        decided.wait();
        if (may_begin) loop();
      });
    };
    std::thread merging = launch(SessionThread::kMerging, [this] { MergeLoop(); });
    std::thread mapping = launch(SessionThread::kMapping, [this, &stop] { MapLoop(stop); });
    std::thread tracking = launch(SessionThread::kTracking, [this] { TrackLoop(); });
    std::thread depth;
    if (engine_.depths() != nullptr) {
      engine_.StopDepth(false);
      depth = std::thread([this, &threads, &decided, &may_begin] {
        threads.ApplyToDepth();
        decided.wait();
        if (may_begin) DepthLoop();
      });
    }
    std::thread capture = launch(SessionThread::kCapture, [this, &stop] { CaptureLoop(stop); });
    applied.wait();
    Status granted = threads.Check();
    if (granted.ok() && requires_realtime_) granted = served_;
    may_begin = granted.ok();
    if (may_begin) observer.OnStart(threads.report());
    decided.count_down();
    std::optional<TimePoint> capture_limit;
    while (may_begin && !tracking_done_.load(std::memory_order_acquire)) {
      Report(observer);
      std::this_thread::sleep_for(milliseconds(10));
      if (!stop.load(std::memory_order_relaxed)) continue;
      if (!capture_limit) capture_limit = clock_.Now() + kPatienceWithCapture;
      if (clock_.Now() >= *capture_limit) is_capture_stuck_.store(true, std::memory_order_relaxed);
    }
    tracking.join();
    mapping.join();
    merging.join();
    if (depth.joinable()) {
      // Nobody waits for the keyframe that it is at.
      stop_depth_.store(true, std::memory_order_release);
      engine_.StopDepth(true);
      depth_work_.Post();
      depth.join();
      engine_.StopDepth(false);
    }
    if (may_begin) Report(observer);
    if (hooks_ != nullptr) hooks_->OnMapsAtRest();
    capture.join();
    if (!may_begin) return granted;
    ReportDamage(observer);
    // Damaged frames after the last one that was tracked.
    ReportMissing(end_index_, end_time_, observer);
    if (!status_.ok()) return status_;
    SessionSummary summary;
    summary.wall_time = clock_.Now() - start;
    summary.video_time = video_time_;
    summary.max_unread = outcomes_.capacity();
    summary.num_frames_unread = outcomes_.num_dropped();
    summary.num_times_unread = mapping_times_.num_dropped() + merging_times_.num_dropped();
    summary.heap_growth_bytes = threads.HeapGrowthBytes();
    return summary;
  }

 private:
  static Duration PeriodOf(double rate_hz, double rate) {
    return Duration(static_cast<std::int64_t>(1e9 / ((rate_hz > 0 ? rate_hz : 25.0) * rate)));
  }
  static Duration BudgetOf(double deadline_ms, Duration period) {
    return deadline_ms > 0 ? Duration(static_cast<std::int64_t>(1e6 * deadline_ms)) : period;
  }

  Status DeviceStatus() const {
    switch (device_ == nullptr ? WatchedVisionDevice::Fault::kNone : device_->fault()) {
      case WatchedVisionDevice::Fault::kLost: return Unavailable("the vision device is lost");
      case WatchedVisionDevice::Fault::kHung: return Unavailable("the vision device hangs");
      case WatchedVisionDevice::Fault::kNone: break;
    }
    return Status::Ok();
  }

  static FrameSlot EmptySlot(const CameraCalibration& camera) {
    FrameSlot slot;
    slot.pixels.resize(FrameBytes(camera));
    return slot;
  }

  void CaptureLoop(const std::atomic<bool>& stop) {
    NameThisThread("capture");
    FrameNumbering numbering(source_.calibration().rate_hz);
    std::uint64_t num_published = 0;
    bool has_origin = false;
    TimePoint origin_video;
    TimePoint origin;
    Duration period = period_;
    TimePoint last_stamp;
    std::uint32_t last_index = 0;
    while (!stop.load(std::memory_order_relaxed)) {
      if (status_ = DeviceStatus(); !status_.ok()) break;
      // A camera that brings nothing must not keep the session from ending, and one that has gone may come back.
      const TimePoint asked = clock_.Now();
      const Result<Frame> frame = source_.Next(asked + kLongestWait);
      // Nobody is left to take it.
      if (is_capture_stuck_.load(std::memory_order_relaxed)) break;
      if (frame.code() == StatusCode::kDeadlineExceeded) continue;
      if (frame.code() == StatusCode::kUnavailable && source_.num_frames() == 0) {
        std::this_thread::sleep_for(milliseconds(10));
        continue;
      }
      if (frame.code() == StatusCode::kNotFound) break;
      if (frame.code() == StatusCode::kDataLoss) {
        const FrameNumbering::Stamp stamp = numbering.Missing();
        const DamageNote note{stamp.frame_index, stamp.timestamp, frame.status().message()};
        while (!damage_.TryPush(note) && !stop.load(std::memory_order_relaxed)) {
          std::this_thread::sleep_for(milliseconds(1));
        }
        continue;
      }
      if (!frame.ok()) {
        status_ = frame.status();
        break;
      }
      // A recording says by its stamps how fast its frames come, whatever its calibration says.
      if (!is_live_ && has_origin && frame->index > last_index && frame->timestamp > last_stamp) {
        const Duration step = (frame->timestamp - last_stamp) / (frame->index - last_index);
        if (step <= kLongestPeriod)
          period = Duration(static_cast<std::int64_t>(static_cast<double>(step.count()) / rate_));
      }
      last_stamp = frame->timestamp;
      last_index = frame->index;
      numbering.Seen(*frame);
      FrameSlot& slot = frames_.WriteSlot();
      CopyImage(frame->image, &slot);
      slot.frame.index = frame->index;
      slot.frame.timestamp = frame->timestamp;
      slot.frame.shows_one_field = frame->shows_one_field;
      slot.is_last = false;
      slot.period = period;
      slot.sequence = num_published + 1;
      const TimePoint now = clock_.Now();
      slot.capture_begin = asked;
      if (is_live_) {
        // A stamp that lies ahead is of another clock.
        slot.due = slot.capture_begin = std::min(frame->timestamp, now);
      } else {
        if (!has_origin) {
          has_origin = true;
          origin_video = frame->timestamp;
          origin = now;
        }
        const double since_origin = static_cast<double>((frame->timestamp - origin_video).count()) / rate_;
        slot.due = origin + Duration(static_cast<std::int64_t>(since_origin));
        if (now > slot.due) {
          // Reading was late: the schedule moves, the frame is not blamed.
          origin += now - slot.due;
          slot.due = now;
        }
        slot.due = SleepUntil(slot.due, stop);
      }
      slot.capture = now - slot.capture_begin;
      slot.handed_over = std::max(now, slot.due);
      frames_.Publish();
      ++num_published;
      frame_ready_.Post();
    }
    video_time_ = numbering.video_time();
    end_index_ = numbering.end_index();
    end_time_ = numbering.end_time();
    // The end must not overtake the last frame: wait until it was taken, or nobody is left to take it.
    while (num_taken_.load(std::memory_order_acquire) < num_published &&
           !tracking_done_.load(std::memory_order_acquire)) {
      std::this_thread::sleep_for(milliseconds(1));
    }
    frames_.WriteSlot().is_last = true;
    frames_.Publish();
    frame_ready_.Post();
  }

  // When the frame is published: earlier than due when the session is to end before.
  TimePoint SleepUntil(TimePoint due, const std::atomic<bool>& stop) const {
    for (TimePoint now = clock_.Now(); now < due; now = clock_.Now()) {
      if (stop.load(std::memory_order_relaxed)) return now;
      if (capture_heartbeat_ != nullptr) capture_heartbeat_->Beat(now);
      std::this_thread::sleep_for(std::min(due - now, kLongestWait));
    }
    return due;
  }

  static void CopyImage(const ImageView& image, FrameSlot* slot) {
    const std::ptrdiff_t row_bytes = static_cast<std::ptrdiff_t>(image.width) * BytesPerPixel(image.format);
    for (int y = 0; y < MemoryRows(image.format, image.height); ++y) {
      std::copy_n(image.row(y), row_bytes, slot->pixels.data() + y * row_bytes);
    }
    slot->frame.image = {slot->pixels.data(), image.width, image.height, row_bytes, image.format};
  }

  void TrackLoop() {
    NameThisThread("tracking");
    while (true) {
      // The mailbox takes the slot back when a newer one is asked for. A device that keeps it is no progress: no beat.
      if (!engine_.MayReleaseFrame(clock_.Now() + kIdle)) continue;
      if (heartbeat_ != nullptr) heartbeat_->Beat(clock_.Now());
      if (!frames_.Refresh()) {
        if (is_capture_stuck_.load(std::memory_order_relaxed)) break;
        (void)frame_ready_.WaitFor(kIdle);
        continue;
      }
      const FrameSlot& slot = frames_.ReadSlot();
      if (slot.is_last) break;
      num_taken_.store(slot.sequence, std::memory_order_release);
      FrameOutcome outcome;
      outcome.due = slot.due;
      outcome.deadline = slot.due + BudgetOf(deadline_ms_, slot.period);
      outcome.capture_begin = slot.capture_begin;
      outcome.capture = slot.capture;
      outcome.shows_one_field = slot.frame.shows_one_field;
      outcome.begin = clock_.Now();
      const ThreadUseMeter meter(thread_watch_);
      outcome.result = engine_.Track(slot.frame, outcome.deadline, slot.handed_over + slot.period);
      const TimePoint end = clock_.Now();
      outcome.processing = outcome.tracking = end - outcome.begin;
      outcome.latency = end - slot.due;
      outcome.is_late = end > outcome.deadline;
      if (hooks_ != nullptr) hooks_->OnTracked(outcome);
      engine_.KeepPicture(slot.frame, outcome.result);
      outcome.use = meter.Read();
      outcomes_.TryPush(outcome);
      newest_tracked_.store(outcome.result.frame_index, std::memory_order_relaxed);
      map_work_.Post();
    }
    stop_mapping_.store(true, std::memory_order_release);
    map_work_.Post();
    tracking_done_.store(true, std::memory_order_release);
  }

  void MapLoop(const std::atomic<bool>& stop) {
    NameThisThread("mapping");
    while (true) {
      if (hooks_ != nullptr) hooks_->BetweenMapSteps();
      const bool is_stopping = stop_mapping_.load(std::memory_order_acquire);
      // After a stop only what the maps need is done, as somebody waits for it. A recording that is over gets all.
      const MapWork work = stop.load(std::memory_order_relaxed) ? MapWork::kNeeded : MapWork::kAll;
      if (MappingTimes times; TimedMapStep(engine_, clock_, work, &times)) {
        times.frame_index = newest_tracked_.load(std::memory_order_relaxed);
        // A figure that finds no room is lost: the mapper does not wait for its observer.
        if (!times.is_empty()) mapping_times_.TryPush(times);
        if (engine_.has_merge_work()) merge_work_.Post();
        if (engine_.has_depth_work()) depth_work_.Post();
        continue;
      }
      // The last answer is waited for: it takes a fraction of a second.
      if (is_stopping && !engine_.is_merging()) break;
      (void)map_work_.WaitFor(kIdle);
    }
    stop_merging_.store(true, std::memory_order_release);
    merge_work_.Post();
  }

  void MergeLoop() {
    NameThisThread("merging");
    while (!stop_merging_.load(std::memory_order_acquire)) {
      if (MappingTimes times; TimedMergeStep(engine_, clock_, &times)) {
        times.frame_index = newest_tracked_.load(std::memory_order_relaxed);
        merging_times_.TryPush(times);
        map_work_.Post();
        continue;
      }
      (void)merge_work_.WaitFor(kIdle);
    }
  }

  void DepthLoop() {
    NameThisThread("depth");
    while (!stop_depth_.load(std::memory_order_acquire)) {
      if (engine_.DepthStep()) {
        map_work_.Post();
      } else {
        (void)depth_work_.WaitFor(kIdle);
      }
    }
  }

  void ReportDamage(SessionObserver& observer) {
    for (DamageNote note; damage_.TryPop(&note);) {
      damaged_.push_back({note.frame_index, note.timestamp});
      observer.OnDamagedFrame(note.frame_index, note.message);
    }
    // Only the first whole frame tells when those before it were; it is not waited for without end.
    if (next_index_ == 0 && damaged_.size() <= kMaxDamageNotes) return;
    std::size_t count = 0;
    for (; count < damaged_.size() && damaged_[count].frame_index == next_index_; ++count) {
      ReportMissingFrame(damaged_[count].timestamp, true, observer);
    }
    ForgetDamaged(count);
  }

  void ForgetDamaged(std::size_t count) {
    damaged_.erase(damaged_.begin(), damaged_.begin() + static_cast<std::ptrdiff_t>(count));
  }

  // The one with `next_index_`.
  void ReportMissingFrame(TimePoint timestamp, bool is_damaged, SessionObserver& observer) {
    FrameOutcome missing;
    missing.result.frame_index = next_index_++;
    missing.result.timestamp = timestamp;
    missing.result.state = TrackingState::kLost;
    missing.result.reason = TrackingReason::kDamagedFrame;
    missing.is_damaged = is_damaged;
    missing.is_dropped = !is_damaged;
    observer.OnFrame(missing);
  }

  // The frames before `end_index` that were not tracked; `end` is the time of the frame with that index.
  void ReportMissing(std::uint32_t end_index, TimePoint end, SessionObserver& observer) {
    const double period_ns = source_.calibration().rate_hz > 0 ? 1e9 / source_.calibration().rate_hz : 4e7;
    std::size_t num_passed = 0;
    const auto pass = [&] {
      while (num_passed < damaged_.size() && damaged_[num_passed].frame_index < next_index_) ++num_passed;
    };
    while (next_index_ < end_index) {
      pass();
      const bool is_damaged = num_passed < damaged_.size() && damaged_[num_passed].frame_index == next_index_;
      const TimePoint timestamp = end - Duration(static_cast<std::int64_t>(period_ns * (end_index - next_index_)));
      ReportMissingFrame(timestamp, is_damaged, observer);
    }
    pass();
    ForgetDamaged(num_passed);
  }

  void Report(SessionObserver& observer) {
    ReportDamage(observer);
    for (FrameOutcome outcome; outcomes_.TryPop(&outcome);) {
      // What was damaged before this frame was noted before this frame was tracked.
      ReportDamage(observer);
      ReportMissing(outcome.result.frame_index, outcome.result.timestamp, observer);
      next_index_ = outcome.result.frame_index + 1;
      observer.OnFrame(outcome);
    }
    for (LatePose pose; engine_.late_poses().TryPop(&pose);) observer.OnLatePose(pose);
    for (MappingTimes times; mapping_times_.TryPop(&times);) observer.OnMapped(times);
    for (MappingTimes times; merging_times_.TryPop(&times);) observer.OnMapped(times);
    for (MapEvent event; engine_.map_events().TryPop(&event);) observer.OnMapEvent(event);
  }

  // How long a thread waits for work before it looks around: heartbeat, end of the session.
  static constexpr Duration kIdle = milliseconds(20);

  FrameSource& source_;
  Engine& engine_;
  const Clock& clock_;
  const bool is_live_;
  const double rate_;
  const Duration period_;  // between two frames, as the source states it
  const double deadline_ms_;
  Heartbeat* const heartbeat_;
  Heartbeat* const capture_heartbeat_;
  SessionHooks* const hooks_;
  const WatchedVisionDevice* const device_;
  const bool requires_realtime_;
  Status served_;  // tracking by the device's threads; written by tracking before all threads begin
  const ThreadWatch* thread_watch_ = nullptr;
  LatestMailbox<FrameSlot> frames_;
  WakeSignal frame_ready_;
  WakeSignal map_work_;
  WakeSignal merge_work_;
  WakeSignal depth_work_;
  SpscRing<FrameOutcome> outcomes_;
  SpscRing<MappingTimes> mapping_times_;
  SpscRing<MappingTimes> merging_times_;
  SpscRing<DamageNote> damage_;
  std::atomic<std::uint32_t> newest_tracked_{0};
  std::atomic<std::uint64_t> num_taken_{0};  // sequence of the newest frame that tracking has begun
  // It was told to stop, and has not: tracking ends without it.
  std::atomic<bool> is_capture_stuck_{false};
  std::atomic<bool> stop_mapping_{false};
  std::atomic<bool> stop_merging_{false};
  std::atomic<bool> stop_depth_{false};
  std::atomic<bool> tracking_done_{false};
  Status status_;                 // written by capture, read after join
  Duration video_time_{0};        // likewise
  std::uint32_t end_index_ = 0;   // likewise
  TimePoint end_time_;            // likewise
  std::vector<Damaged> damaged_;  // not reported yet, in order
  std::uint32_t next_index_ = 0;
};

}  // namespace

MemoryPlan PlanRealTimeSession(const CameraCalibration& calibration) {
  using Frames = LatestMailbox<FrameSlot>;
  const std::size_t max_unread = RealTimeOptions{}.max_unread;
  const std::size_t rings = SpscRing<FrameOutcome>::BytesFor(max_unread) +
                            2 * SpscRing<MappingTimes>::BytesFor(max_unread) +
                            SpscRing<DamageNote>::BytesFor(kMaxDamageNotes);
  MemoryPlan plan;
  plan.Add(MemoryPlace::kHost, "frames in flight", Frames::kNumSlots,
           Frames::BytesFor() + Frames::kNumSlots * FrameBytes(calibration), "image size; real-time mode");
  plan.Add(MemoryPlace::kHost, "rings of the session", 3 * max_unread + kMaxDamageNotes, rings, "real-time mode");
  return plan;
}

Result<SessionSummary> RunRealTime(FrameSource& source, Engine& engine, const Clock& clock,
                                   const RealTimeOptions& options, SessionObserver& observer,
                                   const std::atomic<bool>& stop) {
  if (!(options.rate > 0)) return InvalidArgument("rate must be above zero");
  RealTimeSession session(source, engine, clock, options);
  RealTimeThreads threads(options.rt, options.system != nullptr ? *options.system : LinuxThreadSystem());
  return session.Run(threads, observer, stop);
}

Result<SessionSummary> RunRealTime(FrameSource& source, Engine& engine, const Clock& clock, double rate,
                                   SessionObserver& observer, const std::atomic<bool>& stop) {
  RealTimeOptions options;
  options.rate = rate;
  options.rt.enabled = false;
  return RunRealTime(source, engine, clock, options, observer, stop);
}

}  // namespace haustra
