// What a measurement keeps: a histogram a stage, counters, and the last frames for the trace. Memory is fixed at the
// start, however long it runs. thread-bound(the session's observer).
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "platform/session/session.h"
#include "tools/latency/latency_histogram.h"
#include "tools/latency/requirement.h"

namespace haustra {

class LatencyRecord final : public SessionObserver {
 public:
  // Frames before warm_up_frames count for nothing: their pages are touched for the first time. Keeps the last
  // trace_frames frames. on_start is called once, when the session has started and frames come; on_enough once, after
  // `enough_frames` measured ones (0: never). Both may be empty.
  LatencyRecord(std::uint32_t warm_up_frames, std::size_t trace_frames, std::uint64_t enough_frames,
                std::function<void()> on_start, std::function<void()> on_enough);

  void OnStart(const RealTimeReport& report) override;
  void OnFrame(const FrameOutcome& outcome) override;
  void OnMapEvent(const MapEvent& event) override { num_map_events_ += event.kind == MapEventKind::kMapCreated; }
  void OnLatePose(const LatePose&) override {}
  void OnMapped(const MappingTimes& times) override;
  void OnDamagedFrame(std::uint32_t, const std::string&) override {}

  struct StageHistogram {
    std::string name;
    LatencyHistogram histogram;
  };
  // End to end first, then the stages of a frame in order, then those of mapping.
  const std::vector<StageHistogram>& stages() const { return stages_; }
  const LatencyHistogram& end_to_end() const { return stages_.front().histogram; }
  LatencyFigureValues Values() const;

  const std::optional<RealTimeReport>& realtime() const { return realtime_; }
  std::uint64_t num_measured() const { return end_to_end().count(); }
  std::uint64_t num_warm_up() const { return num_warm_up_; }
  std::uint64_t num_tracking() const { return num_tracking_; }
  const std::array<std::uint64_t, kNumRungs>& num_on_rung() const { return num_on_rung_; }
  const ThreadUse& use() const { return use_; }
  const std::deque<FrameOutcome>& last_frames() const { return last_frames_; }
  const std::deque<MappingTimes>& last_mappings() const { return last_mappings_; }
  // Latency over time: the largest of each second, in ms.
  const std::vector<float>& worst_of_second() const { return worst_of_second_; }

 private:
  LatencyHistogram& Stage(const std::string& name);

  const std::uint32_t warm_up_frames_;
  const std::size_t trace_frames_;
  const std::uint64_t enough_frames_;
  std::function<void()> on_start_, on_enough_;
  std::vector<StageHistogram> stages_;
  std::optional<RealTimeReport> realtime_;
  std::uint64_t num_warm_up_ = 0, num_late_ = 0, num_dropped_ = 0, num_tracking_ = 0, num_map_events_ = 0;
  std::array<std::uint64_t, kNumRungs> num_on_rung_{};
  ThreadUse use_;
  std::deque<FrameOutcome> last_frames_;
  std::deque<MappingTimes> last_mappings_;
  std::vector<float> worst_of_second_;
  std::optional<TimePoint> first_due_;
};

// The stages of mapping in the order in which they follow each other.
std::vector<std::pair<const char*, Duration>> StagesOf(const MappingTimes& times);

}  // namespace haustra
