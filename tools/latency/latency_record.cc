#include "tools/latency/latency_record.h"

#include <algorithm>

namespace haustra {
namespace {

constexpr std::size_t kMaxSeconds = 24 * 3600;

}  // namespace

std::vector<std::pair<const char*, Duration>> StagesOf(const MappingTimes& times) {
  return {{"insert", times.insert}, {"create", times.create},
          {"fuse", times.fuse},     {"bundle", times.bundle},
          {"cull", times.cull},     {"asking", times.asking},
          {"merge", times.merge},   {"relocalisation", times.relocalisation}};
}

LatencyRecord::LatencyRecord(std::uint32_t warm_up_frames, std::size_t trace_frames, std::uint64_t enough_frames,
                             std::function<void()> on_start, std::function<void()> on_enough)
    : warm_up_frames_(warm_up_frames),
      trace_frames_(trace_frames),
      enough_frames_(enough_frames),
      on_start_(std::move(on_start)),
      on_enough_(std::move(on_enough)) {
  for (const char* name : {"end_to_end", "capture", "wake_up", "tracking"}) stages_.push_back({name, {}});
  for (int i = 0; i < kNumStages; ++i) stages_.push_back({std::string(ToString(static_cast<haustra::Stage>(i))), {}});
  for (const auto& [name, duration] : StagesOf(MappingTimes())) {
    stages_.push_back({"mapping/" + std::string(name), {}});
  }
  stages_.push_back({"merging/recognition", {}});
  worst_of_second_.reserve(kMaxSeconds);
}

LatencyHistogram& LatencyRecord::Stage(const std::string& name) {
  return std::find_if(stages_.begin(), stages_.end(), [&](const auto& stage) { return stage.name == name; })->histogram;
}

void LatencyRecord::OnStart(const RealTimeReport& report) {
  realtime_ = report;
  if (on_start_) on_start_();
}

void LatencyRecord::OnFrame(const FrameOutcome& outcome) {
  if (outcome.result.frame_index < warm_up_frames_) {
    ++num_warm_up_;
    return;
  }
  if (outcome.is_damaged) return;
  if (outcome.is_dropped) {
    ++num_dropped_;
    return;
  }
  stages_[0].histogram.Add(outcome.latency);
  stages_[1].histogram.Add(outcome.capture);
  stages_[2].histogram.Add(outcome.begin - outcome.due);
  stages_[3].histogram.Add(outcome.tracking);
  for (std::size_t i = 0; i < outcome.result.times.size(); ++i) {
    if (outcome.result.times[i].count() > 0) stages_[4 + i].histogram.Add(outcome.result.times[i]);
  }
  num_late_ += outcome.is_late;
  num_tracking_ += outcome.result.state == TrackingState::kTracking;
  ++num_on_rung_[static_cast<std::size_t>(outcome.result.rung)];
  use_ += outcome.use;
  if (!first_due_) first_due_ = outcome.due;
  const auto second = static_cast<std::size_t>(std::max(0.0, ToSeconds(outcome.due - *first_due_)));
  if (second < kMaxSeconds) {
    if (worst_of_second_.size() <= second) worst_of_second_.resize(second + 1, 0.0f);
    float& worst = worst_of_second_[second];
    worst = std::max(worst, static_cast<float>(ToMilliseconds(outcome.latency)));
  }
  if (trace_frames_ > 0) {
    if (last_frames_.size() == trace_frames_) last_frames_.pop_front();
    last_frames_.push_back(outcome);
  }
  if (enough_frames_ != 0 && num_measured() == enough_frames_ && on_enough_) on_enough_();
}

void LatencyRecord::OnMapped(const MappingTimes& times) {
  for (const auto& [name, duration] : StagesOf(times)) {
    if (duration.count() > 0) Stage("mapping/" + std::string(name)).Add(duration);
  }
  if (times.recognition.count() > 0) Stage("merging/recognition").Add(times.recognition);
  if (trace_frames_ == 0) return;
  if (last_mappings_.size() == trace_frames_) last_mappings_.pop_front();
  last_mappings_.push_back(times);
}

LatencyFigureValues LatencyRecord::Values() const {
  LatencyFigureValues values;
  values.p50_ms = ToMilliseconds(end_to_end().Quantile(0.5));
  values.p99_ms = ToMilliseconds(end_to_end().Quantile(0.99));
  values.p999_ms = ToMilliseconds(end_to_end().Quantile(0.999));
  values.max_ms = ToMilliseconds(end_to_end().max());
  values.misses = static_cast<double>(num_late_);
  values.drops = static_cast<double>(num_dropped_);
  values.frames = static_cast<double>(num_measured());
  values.predicted = static_cast<double>(num_on_rung_[static_cast<std::size_t>(Rung::kPredicted)]);
  values.reduced = values.frames - static_cast<double>(num_on_rung_[static_cast<std::size_t>(Rung::kFull)]);
  values.page_faults = static_cast<double>(use_.minor_faults) + static_cast<double>(use_.major_faults);
  return values;
}

}  // namespace haustra
