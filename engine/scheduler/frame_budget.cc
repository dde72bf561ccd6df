#include "engine/scheduler/frame_budget.h"

#include <algorithm>
#include <utility>

namespace haustra {
namespace {

// A late frame's waits: longer than any healthy request, short enough for the thread to stay alive.
constexpr Duration kLateWait = std::chrono::milliseconds(100);

template <std::size_t... kIndices>
std::array<StageExpectation, sizeof...(kIndices)> MakeExpectations(const SchedulerConfig& config,
                                                                   std::index_sequence<kIndices...>) {
  const Duration retry_after(static_cast<std::int64_t>(1e6 * config.retry_ms));
  return {((void)kIndices, StageExpectation(config.quantile, retry_after))...};
}

}  // namespace

FrameBudget::FrameBudget(const SchedulerConfig& config, const Clock* clock)
    : config_(config),
      clock_(clock),
      reserve_(static_cast<std::int64_t>(1e6 * config.reserve_ms)),
      lost_time_(static_cast<std::int64_t>(1e6 * config.lost_time_ms)),
      expected_(MakeExpectations(config, std::make_index_sequence<kNumStages>())) {}

void FrameBudget::BeginFrame(TimePoint deadline, bool is_tracking, bool needs_all) {
  deadline_ = deadline;
  rung_ = Rung::kFull;
  times_ = {};
  is_refused_ = {};
  was_run_ = {};
  last_stage_ = -1;
  was_given_up_ = false;
  has_fewer_features_ = has_fewer_points_ = false;
  if (!is_limited()) return;
  const Duration rest = remaining();
  const Duration search = is_tracking ? expected(Stage::kMotion) : Duration{0};
  const Duration full = is_tracking ? expected(Stage::kLocalMap) : Duration{0};
  // What was given up at a deadline took longer than it says, and would seem to fit for ever.
  const Duration margin = needs_all ? reserve_ : Duration{0};
  if (expected(Stage::kExtract) + search + full + margin <= rest) return;
  if (needs_all && expected(Stage::kExtract) <= lost_time_) {
    deadline_ = std::max(deadline, Now() + lost_time_);
    return;
  }
  has_fewer_features_ = true;
  Refuse(Stage::kExtract);
  StepDown(Rung::kFewerFeatures);
  if (!is_tracking || expected(Stage::kExtractReduced) + search + full <= rest) return;
  has_fewer_points_ = true;
  Refuse(Stage::kLocalMap);
  StepDown(Rung::kFewerPoints);
}

void FrameBudget::ReconsiderPoints() {
  if (!is_limited() || has_fewer_points_ || expected(Stage::kLocalMap) <= remaining()) return;
  has_fewer_points_ = true;
  Refuse(Stage::kLocalMap);
  StepDown(Rung::kFewerPoints);
}

bool FrameBudget::CanAfford(Stage stage) {
  if (!is_limited() || expected(stage) <= remaining()) return true;
  Refuse(stage);
  return false;
}

bool FrameBudget::MayRecover(bool is_lost) {
  const bool is_affordable = CanAfford(Stage::kRecovery);
  if (!is_affordable && (!is_lost || num_recovery_refusals_ < kMaxRefusals)) {
    ++num_recovery_refusals_;
    StepDown(Rung::kNoRecovery);
    return false;
  }
  num_recovery_refusals_ = 0;
  // Or the device would not be waited for beyond the end of the frame.
  if (!is_affordable) deadline_ = std::max(deadline_, Now() + kLateWait);
  return true;
}

bool FrameBudget::MayInitialise() {
  may_take_its_time_ = num_initialise_refusals_ >= kMaxRefusals;
  if (may_take_its_time_ || CanAfford(Stage::kInitialise)) return true;
  EndInitialising(true);
  return false;
}

TimePoint FrameBudget::initialise_deadline() const {
  return is_limited() && may_take_its_time_ ? Now() + kLateWait : wait_deadline();
}

void FrameBudget::EndInitialising(bool is_stopped) {
  num_initialise_refusals_ = is_stopped ? num_initialise_refusals_ + 1 : 0;
  if (is_stopped) StepDown(Rung::kNoRecovery);
}

void FrameBudget::StepDown(Rung rung) {
  if (rung > rung_) rung_ = rung;
}

TimePoint FrameBudget::wait_deadline() const {
  if (clock_ == nullptr || deadline_ == kNoDeadline) return deadline_;
  if (!config_.degrade) return kNoDeadline;
  const TimePoint now = Now();
  return now <= deadline_ ? deadline_ - reserve_ : now + kLateWait;
}

bool FrameBudget::is_over() const { return is_limited() && remaining() < Duration{0}; }

Duration FrameBudget::remaining() const { return deadline_ - reserve_ - Now(); }

void FrameBudget::Refuse(Stage stage) { is_refused_[static_cast<std::size_t>(stage)] = true; }

void FrameBudget::Add(Stage stage, Duration duration) {
  const auto i = static_cast<std::size_t>(stage);
  times_[i] += duration;
  was_run_[i] = true;
  last_stage_ = static_cast<int>(i);
}

// One duration a frame, whatever it took to get it.
void FrameBudget::EndFrame() {
  const auto given_up = static_cast<std::size_t>(was_given_up_ ? last_stage_ : -1);
  for (std::size_t i = 0; i < expected_.size(); ++i) {
    if (was_run_[i]) {
      expected_[i].Add(i == given_up ? 2 * times_[i] : times_[i]);
    } else if (is_refused_[i]) {
      expected_[i].Refused(frame_period_);
    }
  }
}

}  // namespace haustra
