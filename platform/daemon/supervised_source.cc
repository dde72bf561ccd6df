#include "platform/daemon/supervised_source.h"

#include <thread>
#include <utility>

namespace haustra {
namespace {

using std::chrono::milliseconds;

// How long a stop may have to wait for the source.
constexpr Duration kPatience = milliseconds(100);
// A frame comes every 40 ms; after so long without one there is no signal.
constexpr Duration kSilence = milliseconds(500);
// A longer step from one frame of a recording to the next is a pause.
constexpr Duration kPause = std::chrono::seconds(10);

}  // namespace

SupervisedSource::SupervisedSource(std::unique_ptr<FrameSource> inner, const Clock& clock)
    : inner_(std::move(inner)), clock_(clock), begin_(clock.Now()), last_frame_(begin_) {}

void SupervisedSource::Begin() {
  begin_ = last_frame_ = clock_.Now();
  last_stamp_ = {};
  shown_.reset();
  answers_.Beat(begin_);
}

void SupervisedSource::SetSignal(SignalState signal, const std::string& text) {
  if (text != signal_text_) {
    const std::lock_guard lock(mutex_);
    signal_text_ = text;
  }
  signal_.store(signal, std::memory_order_relaxed);
}

std::string SupervisedSource::signal_text() const {
  const std::lock_guard lock(mutex_);
  return signal_text_;
}

void SupervisedSource::LookAtTime(const Frame& frame) {
  const TimePoint before = std::exchange(last_stamp_, frame.timestamp);
  // While a camera is away time goes on.
  const bool has_paused = !is_live() && before != TimePoint() && frame.timestamp - before > kPause;
  if (!frame.refused_stamp && !has_paused) return;
  const std::lock_guard lock(mutex_);
  if (time_jump_) {
    ++time_jump_->num_more;
  } else {
    time_jump_ = {before, frame.refused_stamp.value_or(frame.timestamp), frame.timestamp};
  }
}

std::optional<TimeJump> SupervisedSource::TakeTimeJump() {
  const std::lock_guard lock(mutex_);
  return std::exchange(time_jump_, std::nullopt);
}

Result<Frame> SupervisedSource::Next(TimePoint deadline) {
  if (shown_) {
    witness_(*shown_);
    shown_.reset();
  }
  for (bool is_first = true; !stop_.load(std::memory_order_relaxed); is_first = false) {
    if (!is_first && clock_.Now() >= deadline) return Status(StatusCode::kDeadlineExceeded);
    if (signal() == SignalState::kOver) {
      std::this_thread::sleep_for(kPatience / 4);
      answers_.Beat(clock_.Now());
      continue;
    }
    Result<Frame> frame = inner_->Next(clock_.Now() + kPatience);
    const TimePoint now = clock_.Now();
    answers_.Beat(now);
    switch (frame.code()) {
      case StatusCode::kOk:
        // A live source stamps with the clock that this one reads.
        if (is_live() && frame->timestamp < begin_) continue;
        last_frame_ = now;
        LookAtTime(*frame);
        SetSignal(SignalState::kFrames);
        if (witness_) shown_ = *frame;
        return frame;
      case StatusCode::kNotFound: SetSignal(SignalState::kOver); continue;
      case StatusCode::kUnavailable:
        SetSignal(SignalState::kNone, frame.status().message());
        std::this_thread::sleep_for(kPatience);
        continue;
      case StatusCode::kDeadlineExceeded:
        if (now - last_frame_ > kSilence) SetSignal(SignalState::kNone, "no picture comes");
        continue;
      case StatusCode::kDataLoss:
        // To whoever looks at the screen, pictures that are all damaged are no signal.
        if (now - last_frame_ > kSilence) SetSignal(SignalState::kNone, "all pictures are damaged");
        return frame;
      default: return frame;
    }
  }
  return Status(StatusCode::kNotFound);
}

}  // namespace haustra
