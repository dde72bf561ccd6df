// Watches a session for hours: resident memory, pools and latency at intervals of video time, in fixed memory of its
// own, and a verdict at the end. thread-bound(the observer of a session).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "platform/session/session.h"

namespace haustra {

struct SoakOptions {
  Duration interval = std::chrono::seconds(10);  // of video time, between two samples
  // Until then pools, caches and the solver's memory fill; nothing is judged.
  Duration warm_up = std::chrono::minutes(2);
  // Growth of resident memory after the warm-up: the mean of the last quarter of the samples over that of the first.
  double max_growth_mb = 4.0;
  // Median latency of the last quarter of the samples over that of the first, and at least so much in absolute terms:
  // machines are noisy.
  double max_latency_ratio = 1.5;
  double min_latency_drift_ms = 5.0;
};

struct SoakSample {
  double video_s = 0.0;
  double rss_mb = 0.0;
  PoolUse pools;
  std::uint32_t frames = 0;
  std::uint32_t dropped = 0;
  std::uint32_t tracked = 0;
  double p50_ms = 0.0, p99_ms = 0.0, max_ms = 0.0;
  ThreadUse use;  // of the tracking thread
};

struct SoakVerdict {
  bool is_passed = false;
  double growth_mb = 0.0;
  double growth_mb_per_hour = 0.0;  // slope of a line through all samples after the warm-up
  double first_p50_ms = 0.0;
  double last_p50_ms = 0.0;
  std::string text;  // what failed, or that nothing did; a line each
};

class SoakMonitor final : public SessionObserver {
 public:
  // `on_sample` is called for every sample, in order. `heap_watch` may be null.
  SoakMonitor(const Engine& engine, const SoakOptions& options, std::function<void(const SoakSample&)> on_sample,
              const HeapWatch* heap_watch);

  void OnFrame(const FrameOutcome& outcome) override;
  void OnMapEvent(const MapEvent& event) override;
  void OnLatePose(const LatePose&) override {}
  void OnDamagedFrame(std::uint32_t, const std::string&) override { ++num_damaged_; }
  const HeapWatch* heap_watch() const override { return heap_watch_; }

  std::uint64_t num_frames() const { return num_frames_; }
  std::uint64_t num_losses() const { return num_losses_; }
  std::uint64_t num_merges() const { return num_merges_; }
  std::uint64_t num_damaged() const { return num_damaged_; }

  // kInvalidArgument inside the text: too few samples after the warm-up to say anything (not passed).
  SoakVerdict Judge() const;

 private:
  void TakeSample(double video_s);

  const Engine& engine_;
  const SoakOptions options_;
  std::function<void(const SoakSample&)> on_sample_;
  const HeapWatch* heap_watch_;
  std::vector<SoakSample> samples_;
  std::vector<float> latency_ms_;  // of the interval
  SoakSample current_;
  bool has_first_ = false;
  bool was_tracking_ = false;
  TimePoint first_;
  TimePoint next_;
  std::uint64_t num_frames_ = 0;
  std::uint64_t num_losses_ = 0;
  std::uint64_t num_merges_ = 0;
  std::uint64_t num_damaged_ = 0;
};

// Resident memory of this process in megabytes (/proc/self/statm); 0 when it cannot be read.
double ResidentMb();

std::string SoakCsvHeader();
std::string SoakCsvLine(const SoakSample& sample);

}  // namespace haustra
