#include <algorithm>
#include <semaphore>
#include <thread>
#include <vector>

#include "hal/core/mailbox.h"
#include "hal/core/spsc_ring.h"
#include "platform/session/frame_pacer.h"
#include "platform/session/session.h"
#include "platform/session/timed_map_step.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

// A frame on its way from capture to tracking, with its pixels: three of these exist (mailbox).
struct FrameSlot {
  std::vector<std::uint8_t> pixels;
  Frame frame;
  TimePoint due;
  std::uint64_t sequence = 0;  // counts published frames from 1
  bool is_last = false;        // no frame: the source is over
};

struct DamageNote {
  std::uint32_t frame_index = 0;
  std::string message;
};

// State shared by the threads of one session.
class RealTimeSession {
 public:
  RealTimeSession(FrameSource& source, Engine& engine, const Clock& clock, double rate)
      : source_(source),
        engine_(engine),
        clock_(clock),
        rate_(rate),
        frames_(EmptySlot(source.calibration())),
        outcomes_(4096),
        mapping_times_(4096),
        damage_(256) {}

  Result<SessionSummary> Run(SessionObserver& observer, const std::atomic<bool>& stop) {
    const TimePoint start = clock_.Now();
    std::thread mapping([this] { MapLoop(); });
    std::thread tracking([this] { TrackLoop(); });
    std::thread capture([this, &stop] { CaptureLoop(stop); });
    while (!tracking_done_.load(std::memory_order_acquire)) {
      Report(observer);
      std::this_thread::sleep_for(milliseconds(10));
    }
    capture.join();
    tracking.join();
    mapping.join();
    Report(observer);
    // Damaged frames after the last one that was tracked.
    ReportMissing(end_index_, end_time_, observer);
    if (!status_.ok()) return status_;
    SessionSummary summary;
    summary.wall_time = clock_.Now() - start;
    summary.video_time = video_time_;
    return summary;
  }

 private:
  static FrameSlot EmptySlot(const CameraCalibration& camera) {
    FrameSlot slot;
    slot.pixels.resize(static_cast<std::size_t>(camera.width_px) * camera.height_px * 3);
    return slot;
  }

  void CaptureLoop(const std::atomic<bool>& stop) {
    FrameNumbering numbering(source_.calibration().rate_hz);
    std::uint64_t num_published = 0;
    bool has_origin = false;
    TimePoint origin_video;
    TimePoint origin;
    while (!stop.load(std::memory_order_relaxed)) {
      const Result<Frame> frame = source_.Next(kNoDeadline);
      if (frame.code() == StatusCode::kNotFound) break;
      if (frame.code() == StatusCode::kDataLoss) {
        const DamageNote note{numbering.Missing().frame_index, frame.status().message()};
        while (!damage_.TryPush(note)) std::this_thread::sleep_for(milliseconds(1));
        continue;
      }
      if (!frame.ok()) {
        status_ = frame.status();
        break;
      }
      numbering.Seen(*frame);
      FrameSlot& slot = frames_.WriteSlot();
      CopyImage(frame->image, &slot);
      slot.frame.index = frame->index;
      slot.frame.timestamp = frame->timestamp;
      slot.is_last = false;
      slot.sequence = num_published + 1;
      if (!has_origin) {
        has_origin = true;
        origin_video = frame->timestamp;
        origin = clock_.Now();
      }
      const double since_origin = static_cast<double>((frame->timestamp - origin_video).count()) / rate_;
      slot.due = origin + Duration(static_cast<std::int64_t>(since_origin));
      const TimePoint now = clock_.Now();
      if (now > slot.due) {
        // Reading was late: the schedule moves, the frame is not blamed.
        origin += now - slot.due;
        slot.due = now;
      } else {
        std::this_thread::sleep_for(slot.due - now);
      }
      frames_.Publish();
      ++num_published;
      frame_ready_.release();
    }
    video_time_ = numbering.video_time();
    end_index_ = numbering.end_index();
    end_time_ = numbering.end_time();
    // The end must not overtake the last frame: wait until it was taken.
    while (num_taken_.load(std::memory_order_acquire) < num_published) std::this_thread::sleep_for(milliseconds(1));
    frames_.WriteSlot().is_last = true;
    frames_.Publish();
    frame_ready_.release();
  }

  static void CopyImage(const ImageView& image, FrameSlot* slot) {
    const std::ptrdiff_t row_bytes = static_cast<std::ptrdiff_t>(image.width) * BytesPerPixel(image.format);
    for (int y = 0; y < image.height; ++y) {
      std::copy_n(image.row(y), row_bytes, slot->pixels.data() + y * row_bytes);
    }
    slot->frame.image = {slot->pixels.data(), image.width, image.height, row_bytes, image.format};
  }

  void TrackLoop() {
    while (true) {
      if (!frames_.Refresh()) {
        (void)frame_ready_.try_acquire_for(milliseconds(20));
        continue;
      }
      const FrameSlot& slot = frames_.ReadSlot();
      if (slot.is_last) break;
      num_taken_.store(slot.sequence, std::memory_order_release);
      FrameOutcome outcome;
      const TimePoint begin = clock_.Now();
      outcome.result = engine_.Track(slot.frame, kNoDeadline);
      const TimePoint end = clock_.Now();
      outcome.processing = outcome.tracking = end - begin;
      outcome.latency = end - slot.due;
      outcomes_.TryPush(outcome);
      newest_tracked_.store(outcome.result.frame_index, std::memory_order_relaxed);
      map_work_.release();
    }
    stop_mapping_.store(true, std::memory_order_release);
    map_work_.release();
    tracking_done_.store(true, std::memory_order_release);
  }

  void MapLoop() {
    while (true) {
      const bool is_stopping = stop_mapping_.load(std::memory_order_acquire);
      if (MappingTimes times; TimedMapStep(engine_, &times)) {
        times.frame_index = newest_tracked_.load(std::memory_order_relaxed);
        // A figure that finds no room is lost: the mapper does not wait for its observer.
        if (!times.is_empty()) mapping_times_.TryPush(times);
        continue;
      }
      if (is_stopping) break;
      (void)map_work_.try_acquire_for(milliseconds(20));
    }
  }

  void ReportDamage(SessionObserver& observer) {
    for (DamageNote note; damage_.TryPop(&note);) {
      damaged_.push_back(note.frame_index);
      observer.OnDamagedFrame(note.frame_index, note.message);
    }
  }

  // The frames before `end_index` that were not tracked; `end` is the time of the frame with that index.
  void ReportMissing(std::uint32_t end_index, TimePoint end, SessionObserver& observer) {
    const double period_ns = source_.calibration().rate_hz > 0 ? 1e9 / source_.calibration().rate_hz : 4e7;
    for (; next_index_ < end_index; ++next_index_) {
      FrameOutcome missing;
      missing.result.frame_index = next_index_;
      missing.result.timestamp = end - Duration(static_cast<std::int64_t>(period_ns * (end_index - next_index_)));
      missing.result.state = TrackingState::kLost;
      missing.result.reason = TrackingReason::kDamagedFrame;
      missing.is_damaged = std::find(damaged_.begin(), damaged_.end(), next_index_) != damaged_.end();
      missing.is_dropped = !missing.is_damaged;
      observer.OnFrame(missing);
    }
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
    for (MapEvent event; engine_.map_events().TryPop(&event);) observer.OnMapEvent(event);
  }

  FrameSource& source_;
  Engine& engine_;
  const Clock& clock_;
  const double rate_;
  LatestMailbox<FrameSlot> frames_;
  std::counting_semaphore<> frame_ready_{0};
  std::counting_semaphore<> map_work_{0};
  SpscRing<FrameOutcome> outcomes_;
  SpscRing<MappingTimes> mapping_times_;
  SpscRing<DamageNote> damage_;
  std::atomic<std::uint32_t> newest_tracked_{0};
  std::atomic<std::uint64_t> num_taken_{0};  // sequence of the newest frame that tracking has begun
  std::atomic<bool> stop_mapping_{false};
  std::atomic<bool> tracking_done_{false};
  Status status_;                // written by capture, read after join
  Duration video_time_{0};       // likewise
  std::uint32_t end_index_ = 0;  // likewise
  TimePoint end_time_;           // likewise
  std::vector<std::uint32_t> damaged_;
  std::uint32_t next_index_ = 0;
};

}  // namespace

Result<SessionSummary> RunRealTime(FrameSource& source, Engine& engine, const Clock& clock, double rate,
                                   SessionObserver& observer, const std::atomic<bool>& stop) {
  if (!(rate > 0)) return InvalidArgument("rate must be above zero");
  RealTimeSession session(source, engine, clock, rate);
  return session.Run(observer, stop);
}

}  // namespace haustra
