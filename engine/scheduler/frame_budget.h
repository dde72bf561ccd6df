// What a frame may still do before its deadline. Knows what each stage of tracking is expected to take (a running high
// quantile of its last durations), chooses at the start of a frame how much of everything there is time for, and is
// asked again before each stage that can be left out. The policy is a function of times alone: the same times give the
// same answers. Without a clock or a deadline (sequential mode) everything is affordable, and no clock is read.
//
// Two guards stand behind each other: expectations lead down the ladder early; waits for the device end at
// wait_deadline() whatever was expected, so that the predicted pose still goes out in time.
//
// thread-bound(tracking), rt-safe.
#pragma once

#include <array>
#include <cstdint>

#include "engine/scheduler/rung.h"
#include "engine/scheduler/scheduler_config.h"
#include "engine/scheduler/stage_expectation.h"
#include "hal/clock.h"

namespace haustra {

// Stages of tracking. The reduced ones do the same with fewer features or points.
enum class Stage : std::uint8_t {
  kExtract,
  kExtractReduced,
  kMotion,  // guided search of the last frame's points
  kLocalMap,
  kLocalMapReduced,
  kRecovery,    // brute force
  kInitialise,  // of a new map
  kNumStages,
};
inline constexpr int kNumStages = static_cast<int>(Stage::kNumStages);

constexpr std::string_view ToString(Stage stage) {
  constexpr std::string_view names[] = {"extract",           "extract_reduced", "motion",    "local_map",
                                        "local_map_reduced", "recovery",        "initialise"};
  return stage < Stage::kNumStages ? names[static_cast<int>(stage)] : "unknown";
}

// What a frame spent, by stage; a stage that was run twice counts together. 0: it was not run.
using StageTimes = std::array<Duration, kNumStages>;

class FrameBudget {
 public:
  // `config` outlives it. `clock` may be null: nothing is timed, everything is affordable.
  FrameBudget(const SchedulerConfig& config, const Clock* clock);
  FrameBudget(const SchedulerConfig&& config, const Clock* clock) = delete;

  // Chooses between full and reduced stages for a frame that is tracked, or looked for (is_tracking: false). needs_all:
  // the scope is lost, or nearly so; it has no pose that could be late, and what few features find or found is poor.
  // Such a frame gets all features if that takes no more than config.lost_time_ms, even beyond its deadline; frames
  // that come meanwhile are dropped.
  void BeginFrame(TimePoint deadline, bool is_tracking, bool needs_all);
  void EndFrame();
  // Between the frames as they come now; 40 ms until it is known.
  void SetFramePeriod(Duration period) { frame_period_ = period; }

  bool has_fewer_features() const { return has_fewer_features_; }
  bool has_fewer_points() const { return has_fewer_points_; }
  // Before the local map is searched: what the stages before have really taken is known now.
  void ReconsiderPoints();
  // Whether the stage can be run before the deadline. A refusal is remembered (stage_expectation.h).
  bool CanAfford(Stage stage);
  // As CanAfford for recovery, which steps down when it is refused. After kMaxRefusals refusals in a row it is run, and
  // the frame's deadline moves to 100 ms from now: a lost frame has no pose that could be late.
  bool MayRecover(bool is_lost);
  // Whether a map may be looked for in this frame. Refused without time, which is a step down; what was begun is
  // stopped when the frame's time is over. After kMaxRefusals frames in a row without an end to it, it takes its time.
  bool MayInitialise();
  bool ShouldStopInitialising() const { return !may_take_its_time_ && is_over(); }
  // When to stop waiting for the device in it.
  TimePoint initialise_deadline() const;
  // After MayInitialise has said yes.
  void EndInitialising(bool is_stopped);
  // The stage that was run last was given up at its deadline: it counts as twice as long as it lasted, so that it is
  // not expected to fit the next time.
  void GaveUp() { was_given_up_ = true; }
  // The frame stands at least so far down.
  void StepDown(Rung rung);

  // When to stop waiting for the device. A frame that is late already waits for one more period: it is answered as
  // soon as it can be.
  TimePoint wait_deadline() const;
  // Whether the deadline minus reserve is over. Never without a deadline.
  bool is_over() const;

  Rung rung() const { return rung_; }
  const StageTimes& times() const { return times_; }
  Duration expected(Stage stage) const { return expected_[static_cast<std::size_t>(stage)].value(); }

  // Measures a stage from its construction to its end.
  class Timer {
   public:
    Timer(FrameBudget& budget, Stage stage) : budget_(budget), stage_(stage), start_(budget.Now()) {}
    ~Timer() { budget_.Add(stage_, budget_.Now() - start_); }
    Timer(const Timer&) = delete;
    Timer& operator=(const Timer&) = delete;

   private:
    FrameBudget& budget_;
    Stage stage_;
    TimePoint start_;
  };

 private:
  static constexpr int kMaxRefusals = 3;

  TimePoint Now() const { return clock_ == nullptr ? TimePoint{} : clock_->Now(); }
  void Add(Stage stage, Duration duration);
  bool is_limited() const { return config_.degrade && clock_ != nullptr && deadline_ != kNoDeadline; }
  Duration remaining() const;
  void Refuse(Stage stage);

  const SchedulerConfig& config_;
  const Clock* clock_;
  const Duration reserve_;
  const Duration lost_time_;
  std::array<StageExpectation, kNumStages> expected_;
  StageTimes times_{};
  std::array<bool, kNumStages> is_refused_{};
  std::array<bool, kNumStages> was_run_{};
  int last_stage_ = -1;        // of the frame, -1: none
  bool was_given_up_ = false;  // it
  TimePoint deadline_ = kNoDeadline;
  Duration frame_period_ = std::chrono::milliseconds(40);
  bool has_fewer_features_ = false;
  bool has_fewer_points_ = false;
  int num_recovery_refusals_ = 0;    // in a row
  int num_initialise_refusals_ = 0;  // in a row
  bool may_take_its_time_ = false;   // the attempt to found a map
  Rung rung_ = Rung::kFull;
};

}  // namespace haustra
