#include "engine/scheduler/background_gate.h"

#include <chrono>

#include "hal/sleep.h"

namespace haustra {
namespace {

// Between two looks at the gate: small against the gap, large against the cost of waking up.
constexpr Duration kLook = std::chrono::microseconds(250);
// A frame that is so late does not come (end of the source, camera unplugged).
constexpr Duration kGivenUp = std::chrono::milliseconds(100);

// Nothing is refused here; any time does.
constexpr Duration kNeverRefused{1};

void SleepOnThisMachine(void*, Duration duration) { SleepFor(duration); }

bool IsWorking(std::uint64_t num_frames) { return num_frames % 2 == 1; }

}  // namespace

BackgroundGate::BackgroundGate(const Clock& clock, double quantile)
    : BackgroundGate(clock, quantile, SleepOnThisMachine, nullptr) {}

BackgroundGate::BackgroundGate(const Clock& clock, double quantile, Sleep sleep, void* context)
    : clock_(clock), sleep_(sleep), sleep_context_(context), expected_(quantile, kNeverRefused) {}

bool BackgroundGate::IsOpen(std::uint64_t num_frames, TimePoint now) const {
  if (IsWorking(num_frames)) return false;
  const TimePoint next_due(Duration(next_due_ns_.load(std::memory_order_relaxed)));
  if (next_due == kNoDeadline) return true;
  return now + expected_.value() <= next_due || now >= next_due + kGivenUp;
}

void BackgroundGate::Enter() {
  const std::uint64_t before = num_frames_.load(std::memory_order_acquire);
  const TimePoint start = clock_.Now();
  if (IsOpen(before, start)) return;
  ++num_waits_;
  TimePoint now = start;
  // Until the frame that is worked on, or due, has been answered.
  const std::uint64_t after = IsWorking(before) ? before + 1 : before + 2;
  while (true) {
    const std::uint64_t num_frames = num_frames_.load(std::memory_order_acquire);
    if (num_frames >= after && !IsWorking(num_frames)) break;
    if (num_frames > after + 1) break;  // one frame was enough
    if (IsOpen(num_frames, now)) break;
    sleep_(sleep_context_, kLook);
    now = clock_.Now();
  }
  waited_ += clock_.Now() - start;
}

}  // namespace haustra
