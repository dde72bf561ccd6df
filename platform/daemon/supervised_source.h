// A frame source that a service can rely on, around any: it can be stopped, tells whether there is a signal, waits out
// a camera that went away, and shows that its thread lives.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "hal/clock.h"
#include "hal/frame_source.h"
#include "platform/realtime/heartbeat.h"

namespace haustra {

// A frame whose time stamp is not near the one before, and what became of that.
struct TimeJump {
  TimePoint before;            // the time of the frame before; zero: there was none
  TimePoint stated;            // what the camera or the recording says
  TimePoint taken;             // what the frame was given
  std::uint64_t num_more = 0;  // since
};

enum class SignalState { kWaiting, kFrames, kNone, kOver };

// Next is thread-bound(capture); what other threads call is marked. `clock` outlives it.
class SupervisedSource final : public FrameSource {
 public:
  SupervisedSource(std::unique_ptr<FrameSource> inner, const Clock& clock);

  const CameraCalibration& calibration() const override { return inner_->calibration(); }
  std::uint32_t num_frames() const override { return inner_->num_frames(); }
  bool is_live() const override { return inner_->is_live(); }
  std::optional<PixelFormat> pixel_format() const override { return inner_->pixel_format(); }
  std::string FrameName(std::uint32_t frame_index) const override { return inner_->FrameName(frame_index); }
  ImageView static_mask() const override { return inner_->static_mask(); }
  std::optional<TimePoint> recovering_since() const override { return inner_->recovering_since(); }

  // Waits for the next frame until the deadline (kDeadlineExceeded; a tenth of a second late at most) or RequestStop
  // (kNotFound). A camera that has gone (kUnavailable) or is silent is asked again and again. A recording that is over
  // waits. Frames that a camera had taken before Begin are thrown away. Other errors are passed on: damaged frames
  // without a whole one between them for half a second are no signal.
  Result<Frame> Next(TimePoint deadline) override;

  // Before the first Next: called with every frame, on the capture thread, at the begin of the Next after it. By then
  // the frame has been handed on, and its picture is still valid.
  void SetWitness(std::function<void(const Frame&)> witness) { witness_ = std::move(witness); }

  // Before the first Next: frames count from now.
  void Begin();

  // thread-safe.
  void RequestStop() { stop_.store(true, std::memory_order_relaxed); }
  SignalState signal() const { return signal_.load(std::memory_order_relaxed); }
  // Why there is no signal; empty: there is one, or nobody knows.
  std::string signal_text() const;
  // The first one since the last call, and how many came after it. Of a recording also the end of a pause of ten
  // seconds.
  std::optional<TimeJump> TakeTimeJump();
  // One beat at Begin, then one for each answer of the inner source.
  const Heartbeat& answers() const { return answers_; }

 private:
  void LookAtTime(const Frame& frame);
  // Takes the lock where something changes only.
  void SetSignal(SignalState signal, const std::string& text = {});

  std::unique_ptr<FrameSource> inner_;
  const Clock& clock_;
  std::function<void(const Frame&)> witness_;
  std::optional<Frame> shown_;  // that the witness has not seen
  TimePoint begin_;
  TimePoint last_frame_;
  TimePoint last_stamp_;  // zero: none yet
  std::atomic<bool> stop_{false};
  std::atomic<SignalState> signal_{SignalState::kWaiting};
  mutable std::mutex mutex_;
  std::string signal_text_;  // written by Next
  std::optional<TimeJump> time_jump_;
  Heartbeat answers_;
};

}  // namespace haustra
