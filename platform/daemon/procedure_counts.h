// What has happened in the procedures so far, for status and metrics. Plain data; counters never go back.
#pragma once

#include <array>
#include <cstdint>

#include "engine/mapping/map_event.h"
#include "engine/tracking/frame_result.h"
#include "hal/core/time.h"

namespace haustra {

// Upper bounds of the latency histogram, in seconds; one more bucket holds the rest.
inline constexpr std::array<double, 9> kLatencyBounds_s = {0.005, 0.010, 0.020, 0.030, 0.040, 0.060, 0.100, 0.250, 1.0};
inline constexpr std::size_t kNumStates = 3;
inline constexpr std::size_t kNumReasons = 32;
inline constexpr std::size_t kNumEventKinds = 16;

struct ProcedureCounts {
  std::array<std::uint64_t, kNumStates> frames{};    // answered, by TrackingState
  std::array<std::uint64_t, kNumReasons> reasons{};  // likewise, by TrackingReason
  std::uint64_t frames_dropped = 0;
  std::uint64_t frames_damaged = 0;
  std::array<std::uint64_t, kLatencyBounds_s.size() + 1> latency_buckets{};
  double latency_sum_s = 0.0;
  std::array<std::uint64_t, kNumEventKinds> events{};  // by MapEventKind

  // Of the last frame that was answered.
  bool has_frame = false;
  FrameResult last;
  Duration last_latency{0};

  // Of the running procedure.
  std::uint32_t maps = 0;
  std::uint32_t keyframes = 0;
  std::uint32_t points = 0;

  std::uint64_t checkpoints = 0;
  std::uint64_t checkpoints_failed = 0;
  Duration checkpoint_pause{0};  // of the mapper, for the last one
};

// Without what is of one procedure only.
inline ProcedureCounts WithoutProcedure(ProcedureCounts counts) {
  counts.has_frame = false;
  counts.last = FrameResult{};
  counts.last_latency = Duration{0};
  counts.maps = counts.keyframes = counts.points = 0;
  return counts;
}

}  // namespace haustra
