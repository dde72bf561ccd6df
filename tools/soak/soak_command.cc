#include "tools/soak/soak_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "capture/open_sequence.h"
#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/config/engine_config_table.h"
#include "platform/memory_plan.h"
#include "platform/realtime/one_heap.h"
#include "platform/session/warm_up.h"
#include "platform/trap/allocation_trap.h"
#include "platform/vocabulary_loader.h"
#include "tools/command/common_options.h"
#include "tools/command/configuration_options.h"
#include "tools/command/console.h"
#include "tools/command/missing_calibration.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/command/progress_line.h"
#include "tools/command/stop_signal.h"
#include "tools/command/temporary_folder.h"
#include "tools/exit_codes.h"
#include "tools/render/render_sequence.h"
#include "tools/soak/looping_source.h"
#include "tools/soak/sample_file.h"
#include "tools/soak/soak_monitor.h"

namespace haustra {
namespace {

struct SoakArguments : ConfigurationOptions {
  std::string sequence;
  bool rendered = false;
  double minutes = 60.0;
  double procedure_minutes = 22.0;
  double interval_s = 10.0;
  double warm_up_s = 120.0;
  std::string csv;
  bool overwrite = false;
  std::string mode = "realtime";
  double rate = 1.0;
  double frame_rate_hz = 0.0;
  std::string loop = "back-and-forth";
  double max_growth_mb = SoakOptions{}.max_growth_mb;
  double max_latency_ratio = SoakOptions{}.max_latency_ratio;
  double max_pool_ratio = SoakOptions{}.max_pool_ratio;
  std::optional<std::uint64_t> seed;
};

constexpr const char* kSoakCommand = "soak";

Duration Seconds(double seconds) { return Duration(static_cast<std::int64_t>(seconds * 1e9)); }

// What is mapped has losses and merges in it. Into `folder`; the answer is the sequence.
Result<std::string> RenderInto(const TemporaryFolder& folder) {
  if (folder.path().empty()) return Unavailable("no temporary folder can be made to render into");
  HAUSTRA_ASSIGN(const render::Preset preset, render::FindPreset("losses"));
  render::RenderOptions options = render::RenderOptions::FromPreset(preset);
  options.num_threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  options.stop = &CatchStopSignals();
  console::Note(kSoakCommand, "rendering %d frames", options.num_frames());
  std::string sequence = folder.path() + "/sequence";
  HAUSTRA_TRY(render::RenderSequence(sequence, options, {}));
  return sequence;
}

// Of all procedures.
struct SoakTotals {
  std::string device;
  Duration video_time{0};
  int loops = 0;
  EvictionCounters evicted;
  std::uint64_t keyframes_refused = 0;
};

// One procedure with a device and an engine of its own, as the service does it: made empty, thrown away at the end.
// What was freed goes back to the system then.
Status RunProcedure(const SoakArguments& arguments, const EngineConfig& config, const LoopingSource::Opener& open,
                    Duration video_time, const Vocabulary* vocabulary, SoakMonitor* monitor, SoakTotals* totals,
                    const std::atomic<bool>& stop) {
  HAUSTRA_ASSIGN(const std::unique_ptr<LoopingSource> source,
                 LoopingSource::Create(open, arguments.loop == "back-and-forth", video_time));
  const CameraCalibration& calibration = source->calibration();
  HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(calibration));
  const bool is_realtime = arguments.mode == "realtime";
  const Engine::Mode mode = is_realtime ? Engine::Mode::kRealTime : Engine::Mode::kSequential;
  const int num_threads = NumVisionThreads(arguments.threads, config, mode);
  HAUSTRA_ASSIGN(const MemoryPlan plan, PlanMemory(config, calibration, arguments.device, num_threads));
  HAUSTRA_TRY(CheckMemory(plan, config, AvailableHostMemory()));
  HAUSTRA_ASSIGN(const std::unique_ptr<VisionDevice> device,
                 CreateVisionDevice(arguments.device, config, calibration, num_threads));
  totals->device = DeviceText(*device, num_threads);
  HAUSTRA_TRY(device->SetStaticMask(source->static_mask()));
  if (is_realtime) HAUSTRA_TRY(WarmUp(*device, *source).status());
  const SystemClock clock;
  HAUSTRA_ASSIGN(const DepthSearch depth, CreateDepthSearch(arguments.device, config, camera, source->static_mask()));
  Engine engine(config, camera, *device, mode, &clock, source->static_mask(), vocabulary, depth.matcher.get());
  monitor->Begin(engine);
  RealTimeOptions options;
  options.rate = arguments.rate;
  options.rt = config.rt;
  HAUSTRA_ASSIGN(const SessionSummary session, is_realtime
                                                   ? RunRealTime(*source, engine, clock, options, *monitor, stop)
                                                   : RunSequential(*source, engine, clock, *monitor, stop));
  totals->video_time += session.video_time;
  totals->loops += source->num_loops();
  totals->evicted.num_keyframes += engine.evictions().num_keyframes;
  totals->evicted.num_maps += engine.evictions().num_maps;
  totals->evicted.num_points += engine.evictions().num_points;
  totals->keyframes_refused += engine.mapper_counters().num_keyframes_refused;
  return Status::Ok();
}

std::string ProgressText(const SoakSample& sample) {
  char text[160];
  std::snprintf(text, sizeof(text), "%8.0f s  %7.1f MB resident  %5u keyframes %6u points  p50 %.1f ms  max %.1f ms",
                sample.video_s, sample.rss_mb, sample.pools.keyframes, sample.pools.map_points, sample.p50_ms,
                sample.max_ms);
  return text;
}

void PrintTotals(const SoakArguments& arguments, const SoakMonitor& monitor, const SoakTotals& totals) {
  console::Print(
      "%s, device %s, %.1f min of video in %d procedures and %d loops: %llu frames, %llu losses, %llu merges and "
      "loops, %llu damaged\n"
      "evicted %llu keyframes, %llu maps, %llu points; refused %llu keyframes\n",
      arguments.rendered ? "(rendered)" : arguments.sequence.c_str(), totals.device.c_str(),
      ToSeconds(totals.video_time) / 60.0, monitor.num_procedures(), totals.loops,
      static_cast<unsigned long long>(monitor.num_frames()), static_cast<unsigned long long>(monitor.num_losses()),
      static_cast<unsigned long long>(monitor.num_merges()), static_cast<unsigned long long>(monitor.num_damaged()),
      static_cast<unsigned long long>(totals.evicted.num_keyframes),
      static_cast<unsigned long long>(totals.evicted.num_maps),
      static_cast<unsigned long long>(totals.evicted.num_points),
      static_cast<unsigned long long>(totals.keyframes_refused));
}

// All equally long, so that they can be compared.
int NumProcedures(const SoakArguments& arguments) {
  if (arguments.procedure_minutes <= 0.0) return 1;
  return std::max(1, static_cast<int>(std::lround(arguments.minutes / arguments.procedure_minutes)));
}

// What is to be judged of a run that goes as it should.
int NumJudgedSamples(const SoakArguments& arguments, double procedure_s) {
  const auto intervals = [&](double seconds) {
    return static_cast<int>(std::ceil(seconds / arguments.interval_s - 1e-6));
  };
  const int of_procedure = intervals(procedure_s) - std::max(1, intervals(arguments.warm_up_s));
  return std::max(0, of_procedure) * std::max(1, NumProcedures(arguments) - 1);
}

Status CheckTimes(const SoakArguments& arguments) {
  if (arguments.mode != "realtime" && arguments.rate != 1.0) {
    return InvalidArgument("--rate is the pace of real time: it needs --mode realtime");
  }
  const double procedure_s = 60.0 * arguments.minutes / NumProcedures(arguments);
  const int num_samples = NumJudgedSamples(arguments, procedure_s);
  if (num_samples >= static_cast<int>(kMinJudgedSamples)) return Status::Ok();
  char text[240];
  std::snprintf(text, sizeof(text),
                "--minutes %g in procedures of %g s leaves %d of %zu samples that are needed, after --warm-up %g at "
                "--interval %g; give more, or a shorter warm-up or interval",
                arguments.minutes, procedure_s, num_samples, kMinJudgedSamples, arguments.warm_up_s,
                arguments.interval_s);
  return InvalidArgument(text);
}

int Soak(const SoakArguments& arguments) {
  UseOneHeap();  // as the service does
  if (arguments.rendered == !arguments.sequence.empty()) {
    return console::Fail(kSoakCommand, InvalidArgument("name a sequence, or ask for --rendered"), kExitUsage);
  }
  if (const Status status = CheckTimes(arguments); !status.ok()) {
    return console::Fail(kSoakCommand, status, kExitUsage);
  }
  if (!arguments.csv.empty()) {
    const Status status = CheckOutputFile(arguments.csv, {"a table of haustra soak", {kSoakCsvStart}},
                                          arguments.overwrite, {arguments.sequence, arguments.config});
    if (!status.ok()) return console::FailWriting(kSoakCommand, status);
  }
  const Result<ConfigStore<EngineConfig>> loaded = LoadEngineConfig(arguments.config, arguments.assignments);
  if (!loaded.ok()) return console::Fail(kSoakCommand, loaded.status(), kExitConfig);
  EngineConfig config = loaded->config();
  if (arguments.seed) config.seed = *arguments.seed;
  const Result<std::unique_ptr<const Vocabulary>> vocabulary = LoadVocabularyFor(config);
  if (!vocabulary.ok()) return console::Fail(kSoakCommand, vocabulary.status());
  std::string sequence = arguments.sequence;
  const TemporaryFolder folder("soak");
  if (arguments.rendered) {
    Result<std::string> rendered = RenderInto(folder);
    if (!rendered.ok()) return console::Fail(kSoakCommand, rendered.status());
    sequence = std::move(rendered).value();
  }
  const auto open = [&](bool reversed) {
    SequenceOptions options;
    options.reversed = reversed;
    options.frame_rate_hz = arguments.frame_rate_hz;
    Result<std::unique_ptr<FrameSource>> source = OpenSequence(sequence, options);
    if (!source.ok()) source = WithCalibrationAdvice(source.status(), sequence, options);
    return source;
  };

  SoakOptions options;
  options.interval = Seconds(arguments.interval_s);
  options.warm_up = Seconds(arguments.warm_up_s);
  options.max_growth_mb = arguments.max_growth_mb;
  options.max_latency_ratio = arguments.max_latency_ratio;
  options.max_pool_ratio = arguments.max_pool_ratio;
  ProgressLine line;
  SampleFile csv(arguments.csv);
  const auto write = [&](const SoakSample& sample) {
    line.Update([&] { return ProgressText(sample); });
    csv.Add(sample);
  };
  SoakMonitor monitor(options, write, AllocationTrap::IsAvailable() ? &CountingHeapWatch() : nullptr);
  const std::atomic<bool>& stop_requested = CatchStopSignals();
  const int num_procedures = NumProcedures(arguments);
  const Duration video_time = Seconds(60.0 * arguments.minutes / num_procedures);
  SoakTotals totals;
  for (int i = 0; i < num_procedures && !stop_requested.load(); ++i) {
    const Status status =
        RunProcedure(arguments, config, open, video_time, vocabulary->get(), &monitor, &totals, stop_requested);
    ReturnFreeMemory();
    if (!status.ok()) {
      line.Leave();
      return console::Fail(kSoakCommand, status);
    }
  }
  line.Leave();
  if (!csv.status().ok()) return console::FailWriting(kSoakCommand, csv.status());

  PrintTotals(arguments, monitor, totals);
  const SoakVerdict verdict = monitor.Judge();
  console::Print("%s", verdict.text.c_str());
  if (stop_requested.load()) {
    return console::Fail(kSoakCommand, Status(StatusCode::kCancelled, "stopped before its time"));
  }
  return verdict.is_passed ? kExitOk : kExitNotMet;
}

}  // namespace

void AddSoakCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<SoakArguments>();
  CLI::App* command = app.add_subcommand(
      "soak", "Run procedures over and over for hours of video; fails when memory or pools grow or latency drifts");
  command->add_option("sequence", arguments->sequence, "As for run; image files can be played back and forth");
  command->add_flag("--rendered", arguments->rendered, "Play a colon rendered for the purpose instead");
  command->add_option("--minutes", arguments->minutes, "Time of video")
      ->check(NumberBetween(0.01, 100000.0))
      ->capture_default_str();
  command
      ->add_option(
          "--procedure", arguments->procedure_minutes,
          "Minutes of video, about, after which the procedure ends and another begins with an empty engine; 0: "
          "one procedure")
      ->check(NumberBetween(0.0, 100000.0))
      ->capture_default_str();
  command->add_option("--interval", arguments->interval_s, "Seconds of video between two samples")
      ->check(NumberBetween(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("--warm-up", arguments->warm_up_s, "Seconds of each procedure before anything is judged")
      ->check(NumberBetween(0.0, 100000.0))
      ->capture_default_str();
  command->add_option("--csv", arguments->csv, "File for the samples: memory, pools, latency, faults");
  AddOverwriteFlag(*command, arguments->overwrite);
  command->add_option("--mode", arguments->mode, "realtime: at the camera's pace; sequential: as fast as it goes")
      ->check(CLI::IsMember({"sequential", "realtime"}))
      ->capture_default_str();
  command->add_option("--rate", arguments->rate, "Pace of real-time mode relative to the camera")
      ->check(NumberBetween(0.01, 100.0))
      ->capture_default_str();
  command
      ->add_option("--loop", arguments->loop,
                   "back-and-forth: the camera never jumps; restart: from the beginning again, for recordings, too")
      ->check(CLI::IsMember({"back-and-forth", "restart"}))
      ->capture_default_str();
  command->add_option("--max-growth-mb", arguments->max_growth_mb, "Allowed growth after the warm-up")
      ->check(NumberBetween(0.0, 100000.0))
      ->capture_default_str();
  command->add_option("--max-latency-ratio", arguments->max_latency_ratio, "Allowed drift of the median latency")
      ->check(NumberBetween(1.0, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--max-pool-ratio", arguments->max_pool_ratio,
                   "Allowed growth of what procedures use of a pool, from the first ones to the last ones")
      ->check(NumberBetween(1.0, 1000.0))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "Seed of all random sampling (default: the configuration's)")
      ->transform(WholeNumber<std::uint64_t>());
  AddFrameRateOption(*command, arguments->frame_rate_hz);
  AddConfigurationOptions(*command, *arguments);
  command->callback([arguments, &action] { action = [arguments] { return Soak(*arguments); }; });
}

}  // namespace haustra
