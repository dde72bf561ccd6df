#include "tools/soak/soak_monitor.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <numeric>
#include <span>

#include "hal/core/percentile.h"

namespace haustra {
namespace {

// Hours of samples every ten seconds fit without growing.
constexpr std::size_t kReservedSamples = 100'000;
constexpr std::size_t kMaxFramesOfInterval = 65'536;

double MeanRss(std::span<const SoakSample> samples) {
  return std::accumulate(samples.begin(), samples.end(), 0.0,
                         [](double sum, const SoakSample& s) { return sum + s.rss_mb; }) /
         static_cast<double>(samples.size());
}

double MedianLatency(std::span<const SoakSample> samples) {
  std::vector<double> values;
  for (const SoakSample& sample : samples) values.push_back(sample.p50_ms);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

double SlopePerHour(std::span<const SoakSample> samples) {
  double mean_t = 0.0;
  for (const SoakSample& s : samples) mean_t += s.video_s / static_cast<double>(samples.size());
  const double mean_rss = MeanRss(samples);
  double above = 0.0, below = 0.0;
  for (const SoakSample& s : samples) {
    above += (s.video_s - mean_t) * (s.rss_mb - mean_rss);
    below += (s.video_s - mean_t) * (s.video_s - mean_t);
  }
  return below > 0.0 ? 3600.0 * above / below : 0.0;
}

struct JudgedPool {
  const char* name;
  std::uint32_t PoolUse::*use;
};
// Not keyframe ids: those are never given back, so their number says how many keyframes a procedure made, which in real
// time depends on what else the machine has to do.
constexpr JudgedPool kJudgedPools[] = {
    {"keyframes", &PoolUse::keyframes}, {"map points", &PoolUse::map_points}, {"maps", &PoolUse::maps}};

// Of each procedure in turn: the largest use of the pool.
std::vector<double> Peaks(std::span<const SoakSample> samples, std::uint32_t PoolUse::*use) {
  std::vector<double> peaks;
  for (const SoakSample& sample : samples) {
    if (peaks.size() <= static_cast<std::size_t>(sample.procedure)) peaks.resize(sample.procedure + 1, 0.0);
    peaks[sample.procedure] = std::max(peaks[sample.procedure], static_cast<double>(sample.pools.*use));
  }
  return peaks;
}

double Mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

int FewestLooseSets(std::span<const SoakSample> samples) {
  return std::min_element(samples.begin(), samples.end(),
                          [](const SoakSample& a, const SoakSample& b) { return a.loose_sets < b.loose_sets; })
      ->loose_sets;
}

template <typename... Args>
void Fail(SoakVerdict* verdict, const char* format, Args... args) {
  char text[256];
  std::snprintf(text, sizeof(text), format, args...);
  verdict->is_passed = false;
  verdict->text += std::string("FAILED: ") + text + "\n";
}

void JudgePools(std::span<const SoakSample> samples, const SoakOptions& options, SoakVerdict* verdict) {
  for (const JudgedPool& pool : kJudgedPools) {
    const std::vector<double> peaks = Peaks(samples, pool.use);
    const std::span<const double> all(peaks);
    if (all.size() < 2) continue;
    const std::size_t quarter = std::max<std::size_t>(all.size() / 4, 1);
    const double first = Mean(all.first(quarter));
    const double last = Mean(all.last(quarter));
    if (last <= first + options.min_pool_drift || last <= options.max_pool_ratio * first) continue;
    Fail(verdict, "%s in use grew from %.0f to %.0f at most over %zu procedures, allowed: %.2f times", pool.name, first,
         last, all.size(), options.max_pool_ratio);
  }
}

// The worst of the procedures that are long enough to tell.
void JudgeLooseSets(std::span<const SoakSample> judged, const SoakOptions& options, SoakVerdict* verdict) {
  int worst = 0, worst_first = 0, worst_procedure = 0;
  for (auto begin = judged.begin(); begin != judged.end();) {
    const auto end =
        std::find_if(begin, judged.end(), [&](const SoakSample& s) { return s.procedure != begin->procedure; });
    const std::span<const SoakSample> procedure(begin, end);
    begin = end;
    if (procedure.size() < kMinJudgedSamples) continue;
    const std::size_t quarter = procedure.size() / 4;
    const int first = FewestLooseSets(procedure.first(quarter));
    const int growth = FewestLooseSets(procedure.last(quarter)) - first;
    if (growth <= worst) continue;
    worst = growth;
    worst_first = first;
    worst_procedure = procedure.front().procedure;
  }
  if (worst <= options.max_lost_sets) return;
  Fail(verdict, "feature sets that belong to no keyframe grew from %d to %d in procedure %d, allowed: %d more",
       worst_first, worst_first + worst, worst_procedure + 1, options.max_lost_sets);
}

}  // namespace

double ResidentMb() {
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  if (file == nullptr) return 0.0;
  unsigned long total = 0, resident = 0;
  const int num_read = std::fscanf(file, "%lu %lu", &total, &resident);
  std::fclose(file);
  return num_read == 2 ? static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6 : 0.0;
}

SoakMonitor::SoakMonitor(const SoakOptions& options, std::function<void(const SoakSample&)> on_sample,
                         const ThreadWatch* thread_watch)
    : options_(options), on_sample_(std::move(on_sample)), thread_watch_(thread_watch) {
  // Written to, so that the monitor's own memory does not look like growth.
  samples_.resize(kReservedSamples);
  samples_.clear();
  latency_ms_.resize(kMaxFramesOfInterval);
  latency_ms_.clear();
}

void SoakMonitor::Begin(const Engine& engine) {
  engine_ = &engine;
  num_sets_ = Engine::PlanFor(engine.config(), engine.camera().calibration()).max_feature_sets;
  if (has_first_) earlier_s_ += ToSeconds(newest_ - first_);
  has_first_ = was_tracking_ = false;
  current_ = {};
  latency_ms_.clear();
  ++num_procedures_;
}

void SoakMonitor::OnFrame(const FrameOutcome& outcome) {
  const TimePoint now = newest_ = outcome.result.timestamp;
  if (!has_first_) {
    has_first_ = true;
    first_ = now;
    next_ = now + options_.interval;
  }
  ++num_frames_;
  ++current_.frames;
  current_.dropped += outcome.is_dropped;
  const bool is_tracking = outcome.result.state == TrackingState::kTracking;
  current_.tracked += is_tracking;
  num_losses_ += was_tracking_ && !is_tracking && !outcome.is_dropped;
  if (!outcome.is_dropped) was_tracking_ = is_tracking;
  if (!outcome.is_dropped && !outcome.is_damaged) {
    current_.use += outcome.use;
    if (latency_ms_.size() < kMaxFramesOfInterval) {
      latency_ms_.push_back(static_cast<float>(ToMilliseconds(outcome.latency)));
    }
  }
  if (now >= next_) {
    next_ += options_.interval;
    TakeSample(ToSeconds(now - first_));
  }
}

void SoakMonitor::OnMapEvent(const MapEvent& event) {
  num_merges_ += event.kind == MapEventKind::kMerged || event.kind == MapEventKind::kLoopClosed;
}

void SoakMonitor::TakeSample(double procedure_s) {
  current_.procedure = num_procedures_ - 1;
  current_.procedure_s = procedure_s;
  current_.video_s = earlier_s_ + procedure_s;
  current_.rss_mb = ResidentMb();
  current_.pools = engine_->pool_use();
  current_.loose_sets =
      num_sets_ - static_cast<int>(current_.pools.free_feature_sets) - static_cast<int>(current_.pools.keyframes);
  std::sort(latency_ms_.begin(), latency_ms_.end());
  const std::span<const float> sorted(latency_ms_);
  current_.p50_ms = Percentile(sorted, 500);
  current_.p99_ms = Percentile(sorted, 990);
  current_.max_ms = sorted.empty() ? 0.0 : sorted.back();
  if (samples_.size() < kReservedSamples) samples_.push_back(current_);
  if (on_sample_) on_sample_(current_);
  current_ = {};
  latency_ms_.clear();
}

SoakVerdict SoakMonitor::Judge() const {
  SoakVerdict verdict;
  const int first_judged = num_procedures_ > 1 ? 1 : 0;
  std::vector<SoakSample> warm;
  std::copy_if(samples_.begin(), samples_.end(), std::back_inserter(warm), [&](const SoakSample& sample) {
    return sample.procedure >= first_judged && sample.procedure_s >= ToSeconds(options_.warm_up);
  });
  const std::span<const SoakSample> judged(warm);
  if (judged.size() < kMinJudgedSamples) {
    Fail(&verdict, "%zu samples after the warm-up of %.0f s, at least %zu are needed", judged.size(),
         ToSeconds(options_.warm_up), kMinJudgedSamples);
    return verdict;
  }
  const std::size_t quarter = judged.size() / 4;
  verdict.growth_mb = MeanRss(judged.last(quarter)) - MeanRss(judged.first(quarter));
  verdict.growth_mb_per_hour = SlopePerHour(judged);
  verdict.first_p50_ms = MedianLatency(judged.first(quarter));
  verdict.last_p50_ms = MedianLatency(judged.last(quarter));
  verdict.is_passed = true;
  if (verdict.growth_mb > options_.max_growth_mb) {
    Fail(&verdict, "resident memory grew by %.1f MB after the warm-up (%.1f MB an hour), allowed: %.1f MB",
         verdict.growth_mb, verdict.growth_mb_per_hour, options_.max_growth_mb);
  }
  const double drift_ms = verdict.last_p50_ms - verdict.first_p50_ms;
  if (drift_ms > options_.min_latency_drift_ms &&
      verdict.last_p50_ms > options_.max_latency_ratio * verdict.first_p50_ms) {
    Fail(&verdict, "median latency drifted from %.1f ms to %.1f ms after the warm-up, allowed: %.2f times",
         verdict.first_p50_ms, verdict.last_p50_ms, options_.max_latency_ratio);
  }
  JudgePools(samples_, options_, &verdict);
  JudgeLooseSets(judged, options_, &verdict);
  if (verdict.is_passed) {
    char text[256];
    std::snprintf(text, sizeof(text),
                  "passed: resident memory %+.1f MB after the warm-up (%+.1f MB an hour), median latency %.1f ms, then "
                  "%.1f ms, pools of %d procedures steady\n",
                  verdict.growth_mb, verdict.growth_mb_per_hour, verdict.first_p50_ms, verdict.last_p50_ms,
                  num_procedures_);
    verdict.text = text;
  }
  return verdict;
}

std::string SoakCsvHeader() {
  return std::string(kSoakCsvStart) +
         "rss_mb,keyframes,map_points,maps,keyframe_ids,free_feature_sets,loose_sets,"
         "frames,dropped,tracked,p50_ms,p99_ms,max_ms,minor_faults,major_faults,voluntary_switches,"
         "involuntary_switches,heap_calls\n";
}

std::string SoakCsvLine(const SoakSample& s) {
  char line[320];
  std::snprintf(line, sizeof(line), "%.2f,%d,%.2f,%.3f,%u,%u,%u,%u,%u,%d,%u,%u,%u,%.3f,%.3f,%.3f,%u,%u,%u,%u,%u\n",
                s.video_s, s.procedure, s.procedure_s, s.rss_mb, s.pools.keyframes, s.pools.map_points, s.pools.maps,
                s.pools.keyframe_ids, s.pools.free_feature_sets, s.loose_sets, s.frames, s.dropped, s.tracked, s.p50_ms,
                s.p99_ms, s.max_ms, s.use.minor_faults, s.use.major_faults, s.use.voluntary_switches,
                s.use.involuntary_switches, s.use.trapped_calls);
  return line;
}

}  // namespace haustra
