// What has happened in the procedures so far, for status and metrics. Plain data, also between two processes; counters
// never go back.
#pragma once

#include <array>
#include <cstdint>

#include "engine/atlas/handles.h"
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
  std::uint32_t has_frame = 0;  // 1: there was one
  std::uint32_t last_frame_index = 0;
  TrackingState last_state = TrackingState::kInitialising;
  TrackingReason last_reason = TrackingReason::kFirstView;
  MapId last_map_id = kNoId;
  Duration last_latency{0};

  // Of the running procedure.
  std::uint32_t maps = 0;
  std::uint32_t keyframes = 0;
  std::uint32_t points = 0;
  std::uint32_t keyframes_with_depth = 0;

  // Of keyframes whose depth was to be searched.
  std::uint64_t depths_found = 0;
  std::uint64_t depths_late = 0;        // their pictures had gone before their turn came, or were never taken
  std::uint64_t depths_too_little = 0;  // of too few points, or that no other keyframe sees well
  std::uint64_t depths_in_vain = 0;     // the keyframe was culled meanwhile, or the device failed

  std::uint64_t checkpoints = 0;
  std::uint64_t checkpoints_failed = 0;
  Duration checkpoint_pause{0};  // of the mapper, for the last one
};

// Without what is of one procedure only.
inline ProcedureCounts WithoutProcedure(ProcedureCounts counts) {
  const ProcedureCounts none;
  counts.has_frame = none.has_frame;
  counts.last_frame_index = none.last_frame_index;
  counts.last_state = none.last_state;
  counts.last_reason = none.last_reason;
  counts.last_map_id = none.last_map_id;
  counts.last_latency = none.last_latency;
  counts.maps = counts.keyframes = counts.points = counts.keyframes_with_depth = 0;
  return counts;
}

// What is of one procedure only is that of `later`.
inline ProcedureCounts Sum(const ProcedureCounts& earlier, const ProcedureCounts& later) {
  ProcedureCounts sum = later;
  const auto add = [](auto& into, const auto& values) {
    for (std::size_t i = 0; i < into.size(); ++i) into[i] += values[i];
  };
  add(sum.frames, earlier.frames);
  add(sum.reasons, earlier.reasons);
  add(sum.latency_buckets, earlier.latency_buckets);
  add(sum.events, earlier.events);
  sum.frames_dropped += earlier.frames_dropped;
  sum.frames_damaged += earlier.frames_damaged;
  sum.latency_sum_s += earlier.latency_sum_s;
  sum.depths_found += earlier.depths_found;
  sum.depths_late += earlier.depths_late;
  sum.depths_too_little += earlier.depths_too_little;
  sum.depths_in_vain += earlier.depths_in_vain;
  sum.checkpoints += earlier.checkpoints;
  sum.checkpoints_failed += earlier.checkpoints_failed;
  if (sum.checkpoint_pause.count() == 0) sum.checkpoint_pause = earlier.checkpoint_pause;
  return sum;
}

}  // namespace haustra
