#include "tools/soak/soak_command.h"

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/open_sequence.h"
#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/config/engine_config_table.h"
#include "platform/memory_plan.h"
#include "platform/trap/allocation_trap.h"
#include "platform/vocabulary_loader.h"
#include "tools/command/configuration_options.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"
#include "tools/soak/looping_source.h"
#include "tools/soak/soak_monitor.h"

namespace haustra {
namespace {

struct SoakArguments : ConfigurationOptions {
  std::string sequence;
  double minutes = 60.0;
  double interval_s = 10.0;
  double warm_up_s = 120.0;
  std::string csv;
  std::string mode = "realtime";
  double rate = 1.0;
  std::string loop = "back-and-forth";
  double max_growth_mb = SoakOptions{}.max_growth_mb;
  double max_latency_ratio = SoakOptions{}.max_latency_ratio;
  std::optional<std::uint64_t> seed;
};

// Of what did not go as it should: not a usage error, not an internal one.
constexpr int kExitFailed = 1;

int FailSoak(const Status& status) {
  std::fprintf(stderr, "haustra soak: %s\n", status.ToString().c_str());
  return ExitCodeFor(status.code());
}

Duration Seconds(double seconds) { return Duration(static_cast<std::int64_t>(seconds * 1e9)); }

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

int Soak(const SoakArguments& arguments) {
  const Result<ConfigStore<EngineConfig>> loaded = LoadEngineConfig(arguments.config, arguments.assignments);
  if (!loaded.ok()) {
    std::fprintf(stderr, "haustra soak: %s\n", loaded.status().message().c_str());
    return kExitConfig;
  }
  EngineConfig config = loaded->config();
  if (arguments.seed) config.seed = *arguments.seed;
  const auto open = [&](bool reversed) {
    SequenceOptions options;
    options.reversed = reversed;
    return OpenSequence(arguments.sequence, options);
  };
  Result<std::unique_ptr<LoopingSource>> source =
      LoopingSource::Create(open, arguments.loop == "back-and-forth", Seconds(60.0 * arguments.minutes));
  if (!source.ok()) return FailSoak(source.status());
  const CameraCalibration& calibration = (*source)->calibration();
  const Result<CameraModel> camera = CameraModel::Create(calibration);
  if (!camera.ok()) return FailSoak(camera.status());
  const Result<MemoryPlan> plan = PlanMemory(config, calibration, arguments.device, arguments.threads);
  if (!plan.ok()) return FailSoak(plan.status());
  if (const Status status = CheckMemory(*plan, config, AvailableHostBytes()); !status.ok()) return FailSoak(status);
  Result<std::unique_ptr<VisionDevice>> device =
      CreateVisionDevice(arguments.device, config, calibration, arguments.threads);
  if (!device.ok()) return FailSoak(device.status());
  if (const Status status = (*device)->SetStaticMask((*source)->static_mask()); !status.ok()) return FailSoak(status);
  const Result<std::unique_ptr<const Vocabulary>> vocabulary = LoadVocabularyFor(config);
  if (!vocabulary.ok()) return FailSoak(vocabulary.status());
  std::unique_ptr<std::FILE, FileCloser> csv;
  if (!arguments.csv.empty()) {
    csv.reset(std::fopen(arguments.csv.c_str(), "w"));
    if (csv == nullptr) return FailSoak(Unavailable(arguments.csv + ": cannot be written"));
    std::fputs(SoakCsvHeader().c_str(), csv.get());
  }

  const bool is_realtime = arguments.mode == "realtime";
  const SystemClock clock;
  Engine engine(config, *camera, **device, is_realtime ? Engine::Mode::kRealTime : Engine::Mode::kSequential, &clock,
                SceneShare((*source)->static_mask()), vocabulary->get());
  SoakOptions options;
  options.interval = Seconds(arguments.interval_s);
  options.warm_up = Seconds(arguments.warm_up_s);
  options.max_growth_mb = arguments.max_growth_mb;
  options.max_latency_ratio = arguments.max_latency_ratio;
  bool is_written = true;
  const auto write = [&](const SoakSample& sample) {
    std::fprintf(stderr, "\r%8.0f s  %7.1f MB resident  %5u keyframes %6u points  p50 %.1f ms  max %.1f ms ",
                 sample.video_s, sample.rss_mb, sample.pools.keyframes, sample.pools.map_points, sample.p50_ms,
                 sample.max_ms);
    if (csv == nullptr) return;
    is_written = std::fputs(SoakCsvLine(sample).c_str(), csv.get()) >= 0 && std::fflush(csv.get()) == 0 && is_written;
  };
  SoakMonitor monitor(engine, options, write, AllocationTrap::IsAvailable() ? &CountingHeapWatch() : nullptr);
  const std::atomic<bool>& stop_requested = CatchStopSignals();
  const Result<SessionSummary> session =
      is_realtime ? RunRealTime(**source, engine, clock, arguments.rate, monitor, stop_requested)
                  : RunSequential(**source, engine, clock, monitor, stop_requested);
  std::fprintf(stderr, "\n");
  if (!session.ok()) return FailSoak(session.status());
  if (!is_written) return FailSoak(Unavailable(arguments.csv + ": could not be written"));

  const EvictionCounters& evicted = engine.evictions();
  std::printf(
      "%s, %.1f min of video in %d loops: %llu frames, %llu losses, %llu merges and loops, %llu damaged\n"
      "evicted %llu keyframes, %llu maps, %llu points; refused %llu keyframes; engine's plan %.0f MB\n",
      arguments.sequence.c_str(), ToSeconds(session->video_time) / 60.0, (*source)->num_loops(),
      static_cast<unsigned long long>(monitor.num_frames()), static_cast<unsigned long long>(monitor.num_losses()),
      static_cast<unsigned long long>(monitor.num_merges()), static_cast<unsigned long long>(monitor.num_damaged()),
      static_cast<unsigned long long>(evicted.num_keyframes), static_cast<unsigned long long>(evicted.num_maps),
      static_cast<unsigned long long>(evicted.num_points),
      static_cast<unsigned long long>(engine.mapper_counters().num_keyframes_refused),
      static_cast<double>(plan->host_bytes()) / 1e6);
  const SoakVerdict verdict = monitor.Judge();
  std::fputs(verdict.text.c_str(), stdout);
  if (stop_requested.load()) {
    std::fprintf(stderr, "haustra soak: stopped before its time\n");
    return kExitFailed;
  }
  return verdict.is_passed ? kExitOk : kExitFailed;
}

}  // namespace

void AddSoakCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<SoakArguments>();
  CLI::App* command = app.add_subcommand(
      "soak", "Run a sequence over and over for hours of video; fails when memory grows or latency drifts");
  command->add_option("sequence", arguments->sequence, "As for run; image files can be played back and forth")
      ->required();
  command->add_option("--minutes", arguments->minutes, "Time of video")
      ->check(CLI::Range(0.01, 100000.0))
      ->capture_default_str();
  command->add_option("--interval", arguments->interval_s, "Seconds of video between two samples")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("--warm-up", arguments->warm_up_s, "Seconds of video before anything is judged")
      ->check(CLI::Range(0.0, 100000.0))
      ->capture_default_str();
  command->add_option("--csv", arguments->csv, "File for the samples: memory, pools, latency, faults");
  command->add_option("--mode", arguments->mode, "realtime: at the camera's pace; sequential: as fast as it goes")
      ->check(CLI::IsMember({"sequential", "realtime"}))
      ->capture_default_str();
  command->add_option("--rate", arguments->rate, "Pace of real-time mode relative to the camera")
      ->check(CLI::Range(0.01, 100.0))
      ->capture_default_str();
  command
      ->add_option("--loop", arguments->loop,
                   "back-and-forth: the camera never jumps; restart: from the beginning again, for recordings, too")
      ->check(CLI::IsMember({"back-and-forth", "restart"}))
      ->capture_default_str();
  command->add_option("--max-growth-mb", arguments->max_growth_mb, "Allowed growth after the warm-up")
      ->check(CLI::Range(0.0, 100000.0))
      ->capture_default_str();
  command->add_option("--max-latency-ratio", arguments->max_latency_ratio, "Allowed drift of the median latency")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "Seed of all random sampling (default: the configuration's)")
      ->check(CLI::NonNegativeNumber);
  AddConfigurationOptions(*command, *arguments);
  command->callback([arguments, &action] { action = [arguments] { return Soak(*arguments); }; });
}

}  // namespace haustra
