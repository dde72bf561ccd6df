// Watches procedures for hours: resident memory, pools and latency at intervals of video time, in fixed memory of its
// own, and a verdict at the end. thread-bound(the observer of the sessions).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/engine.h"
#include "platform/session/session.h"

namespace haustra {

// After the warm-up, of all procedures that are judged: with fewer there is no verdict.
inline constexpr std::size_t kMinJudgedSamples = 8;

struct SoakOptions {
  Duration interval = std::chrono::seconds(10);  // of video time, between two samples
  // So long pools, caches and the solver's memory fill in every procedure; nothing is judged. Nor is the first one of
  // several, but for its pools: once its memory has been given back, malloc serves large blocks in another way.
  Duration warm_up = std::chrono::minutes(2);
  // Growth of resident memory: the mean of the last quarter of the judged samples over that of the first.
  double max_growth_mb = 4.0;
  // Median latency of the last quarter of the judged samples over that of the first, and at least so much in absolute
  // terms: machines are noisy.
  double max_latency_ratio = 1.5;
  double min_latency_drift_ms = 5.0;
  // Largest use of a pool by a procedure, the mean of the last quarter of the procedures over that of the first, and at
  // least so many entries more: in real time no two are alike. Within a procedure pools may fill: a full one makes
  // room.
  double max_pool_ratio = 1.5;
  double min_pool_drift = 10.0;
  // Feature sets in use that belong to no keyframe: the fewest in the last quarter of a procedure's judged samples over
  // the fewest in the first. So many frames are on their way at any time; more were forgotten.
  int max_lost_sets = 8;
};

struct SoakSample {
  int procedure = 0;         // from 0
  double video_s = 0.0;      // of all procedures
  double procedure_s = 0.0;  // of this one
  double rss_mb = 0.0;
  PoolUse pools;
  int loose_sets = 0;  // feature sets in use that belong to no keyframe
  std::uint32_t frames = 0;
  std::uint32_t dropped = 0;
  std::uint32_t tracked = 0;
  double p50_ms = 0.0, p99_ms = 0.0, max_ms = 0.0;
  ThreadUse use;  // of the tracking thread
};

struct SoakVerdict {
  bool is_passed = false;
  double growth_mb = 0.0;
  double growth_mb_per_hour = 0.0;  // slope of a line through all judged samples
  double first_p50_ms = 0.0;
  double last_p50_ms = 0.0;
  std::string text;  // what failed, or that nothing did; a line each
};

class SoakMonitor final : public SessionObserver {
 public:
  // `on_sample` is called for every sample, in order. `thread_watch` may be null.
  SoakMonitor(const SoakOptions& options, std::function<void(const SoakSample&)> on_sample,
              const ThreadWatch* thread_watch);

  // Before the session of each procedure; its time begins anew. The engine is asked during that session only.
  void Begin(const Engine& engine);

  void OnFrame(const FrameOutcome& outcome) override;
  void OnMapEvent(const MapEvent& event) override;
  void OnLatePose(const LatePose&) override {}
  void OnDamagedFrame(std::uint32_t, const std::string&) override { ++num_damaged_; }
  const ThreadWatch* thread_watch() const override { return thread_watch_; }

  int num_procedures() const { return num_procedures_; }
  std::uint64_t num_frames() const { return num_frames_; }
  std::uint64_t num_losses() const { return num_losses_; }
  std::uint64_t num_merges() const { return num_merges_; }
  std::uint64_t num_damaged() const { return num_damaged_; }

  // Too few samples after the warm-up to say anything: not passed.
  SoakVerdict Judge() const;

 private:
  void TakeSample(double procedure_s);

  const SoakOptions options_;
  std::function<void(const SoakSample&)> on_sample_;
  const ThreadWatch* thread_watch_;
  const Engine* engine_ = nullptr;
  int num_sets_ = 0;  // of the engine's device
  std::vector<SoakSample> samples_;
  std::vector<float> latency_ms_;  // of the interval
  SoakSample current_;
  int num_procedures_ = 0;
  bool has_first_ = false;  // of the procedure
  bool was_tracking_ = false;
  TimePoint first_;
  TimePoint newest_;
  TimePoint next_;
  double earlier_s_ = 0.0;  // video of earlier procedures
  std::uint64_t num_frames_ = 0;
  std::uint64_t num_losses_ = 0;
  std::uint64_t num_merges_ = 0;
  std::uint64_t num_damaged_ = 0;
};

// Resident memory of this process in megabytes (/proc/self/statm); 0 when it cannot be read.
double ResidentMb();

// Of every such table, and of nothing else that is written.
inline constexpr std::string_view kSoakCsvStart = "video_s,procedure,procedure_s,";
std::string SoakCsvHeader();
std::string SoakCsvLine(const SoakSample& sample);

}  // namespace haustra
