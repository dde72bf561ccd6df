#include "tools/latency/latency_command.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "capture/open_sequence.h"
#include "engine/engine.h"
#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/config/engine_config_table.h"
#include "platform/memory_plan.h"
#include "platform/realtime/one_heap.h"
#include "platform/session/session.h"
#include "platform/session/warm_up.h"
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
#include "tools/latency/board_state.h"
#include "tools/latency/latency_page.h"
#include "tools/latency/latency_record.h"
#include "tools/latency/looped_source.h"
#include "tools/latency/requirement.h"
#include "tools/latency/stress.h"
#include "tools/latency/stress_process.h"
#include "tools/latency/trace_json.h"
#include "tools/render/render_sequence.h"

namespace haustra {
namespace {

constexpr const char* kLatencyCommand = "latency";
constexpr FolderContent kLatencyContent{"a measurement", R"(latency\.(html|json)|histogram\.txt|trace\.json)"};

constexpr double kDefaultSeconds = 60.0;

struct LatencyArguments : ConfigurationOptions {
  std::string sequence;
  bool rendered = false;
  std::string out;
  std::string require;
  double seconds = 0.0;
  double rate = 1.0;
  double warm_up_s = 2.0;
  double loop_s = 8.0;
  double trace_s = 20.0;
  bool stress = false;
  int stress_cpu = 0;
  int stress_memory = 0;
  bool stress_gpu = false;
  bool stress_process = false;
  std::string occupy;    // WIDTHxHEIGHT, in the second process
  SequenceOptions part;  // of the sequence: how it is read
  bool overwrite = false;
};

// The frames to play: of the sequence, or rendered for the purpose.
Result<std::unique_ptr<LoopedSource>> LoadFrames(const LatencyArguments& arguments) {
  std::string sequence = arguments.sequence;
  const TemporaryFolder folder("latency");
  if (arguments.rendered) {
    if (folder.path().empty()) return Unavailable("no temporary folder can be made to render into");
    HAUSTRA_ASSIGN(const render::Preset preset, render::FindPreset("standard"));
    render::RenderOptions rendering = render::RenderOptions::FromPreset(preset);
    rendering.seconds = arguments.loop_s;
    rendering.events.clear();
    rendering.num_threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    rendering.stop = &CatchStopSignals();
    console::Note(kLatencyCommand, "rendering %d frames", rendering.num_frames());
    sequence = folder.path() + "/sequence";
    HAUSTRA_TRY(render::RenderSequence(sequence, rendering, {}));
  }
  const Result<std::unique_ptr<FrameSource>> source = OpenSequence(sequence, arguments.part);
  if (!source.ok()) return WithCalibrationAdvice(source.status(), sequence, arguments.part);
  const double rate_hz = (*source)->calibration().rate_hz > 0 ? (*source)->calibration().rate_hz : 25.0;
  return LoopedSource::Load(**source, std::max(2, static_cast<int>(std::lround(arguments.loop_s * rate_hz))));
}

Status WriteResults(const std::string& folder, const LatencyReport& report) {
  std::string histograms = HistogramFileHeader();
  for (const LatencyRecord::StageHistogram& stage : report.record->stages()) {
    if (stage.histogram.count() > 0) histograms += ToFileText(stage.name, stage.histogram);
  }
  HAUSTRA_TRY(WriteFile(folder + "/histogram.txt", histograms));
  HAUSTRA_TRY(WriteFile(folder + "/trace.json", MakeTraceJson(*report.record)));
  HAUSTRA_TRY(WriteFile(folder + "/latency.json", ToJson(report)));
  return WriteFile(folder + "/latency.html", MakeLatencyPage(report));
}

// What became of the frames, and what to change.
Status NothingMeasured(const LatencyRecord& record, double seconds) {
  char text[200];
  std::snprintf(
      text, sizeof(text),
      "no frame was measured in %.1f s: %llu to warm up, %.0f dropped; give more --seconds, a shorter --warm-up, "
      "or a smaller --rate where frames are dropped",
      seconds, static_cast<unsigned long long>(record.num_warm_up()), record.Values().drops);
  return FailedPrecondition(text);
}

// A device beside the one that is measured, small but never idle.
Result<std::unique_ptr<VisionDevice>> MakeStressDevice(const LatencyArguments& arguments,
                                                       const CameraCalibration& calibration) {
  EngineConfig config;
  config.memory.max_keyframes = 16;
  VisionPlan plan = Engine::PlanFor(config, calibration);
  plan.extracts_in_background = true;
  return CreateVisionDevice(arguments.device, plan, Engine::ExtractOptionsFor(config), 1);
}

Result<std::unique_ptr<StressProcess>> StartStressProcess(const LatencyArguments& arguments,
                                                          const CameraCalibration& calibration) {
  return StressProcess::Start({"latency", "--occupy",
                               std::to_string(calibration.width_px) + "x" + std::to_string(calibration.height_px),
                               "--device", arguments.device});
}

// What keeps the machine busy beside what is measured.
struct Load {
  StressOptions threads;
  std::unique_ptr<VisionDevice> device;    // for a thread that works on it; null: none does
  std::unique_ptr<StressProcess> process;  // null: none
};

Result<Load> MakeLoad(const LatencyArguments& arguments, const CameraCalibration& calibration, bool has_accelerator) {
  Load load;
  load.threads = {arguments.stress_cpu, arguments.stress_memory};
  if (arguments.stress) {
    const int num_cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    load.threads.cpu_threads = std::max(load.threads.cpu_threads, num_cores);
    load.threads.memory_threads = std::max(load.threads.memory_threads, 1);
  }
  if (arguments.stress_gpu || (arguments.stress && has_accelerator)) {
    HAUSTRA_ASSIGN(load.device, MakeStressDevice(arguments, calibration));
  }
  if (arguments.stress_process) {
    HAUSTRA_ASSIGN(load.process, StartStressProcess(arguments, calibration));
  }
  return load;
}

std::string LoadText(const Load& load) {
  std::string text = std::to_string(load.threads.cpu_threads) + " threads of arithmetic, " +
                     std::to_string(load.threads.memory_threads) + " of copying";
  if (load.device != nullptr) text += ", one on the vision device";
  if (load.process != nullptr) text += ", a second process on the vision device";
  return text;
}

// Sets *stop when the time is over or a signal asks for it, and shows until then how far it is.
class MeasuringTimer {
 public:
  MeasuringTimer(const SystemClock& clock, TimePoint begin, double seconds, const std::atomic<bool>& stop_requested,
                 std::atomic<bool>* stop)
      : thread_([this, &clock, begin, seconds, &stop_requested, stop] {
          ProgressLine line;
          const TimePoint end = begin + Duration(static_cast<std::int64_t>(1e9 * seconds));
          while (!is_over_ && !*stop && !stop_requested && clock.Now() < end) {
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
            line.Update([&] {
              char text[80];
              std::snprintf(text, sizeof(text), "measuring %.0f / %.0f s", line.elapsed_s(), seconds);
              return std::string(text);
            });
          }
          *stop = true;
        }) {}
  ~MeasuringTimer() {
    is_over_ = true;
    thread_.join();
  }
  MeasuringTimer(const MeasuringTimer&) = delete;
  MeasuringTimer& operator=(const MeasuringTimer&) = delete;

 private:
  std::atomic<bool> is_over_{false};
  std::thread thread_;
};

// The second process.
int Occupy(const LatencyArguments& arguments) {
  CameraCalibration calibration;
  if (std::sscanf(arguments.occupy.c_str(), "%dx%d", &calibration.width_px, &calibration.height_px) != 2) {
    return console::Fail(kLatencyCommand, InvalidArgument("--occupy: WIDTHxHEIGHT"), kExitUsage);
  }
  Result<std::unique_ptr<VisionDevice>> device = MakeStressDevice(arguments, calibration);
  if (!device.ok()) return console::Fail(kLatencyCommand, device.status());
  OccupyUntilInputEnds(std::move(device).value());
  return kExitOk;
}

int Measure(const LatencyArguments& arguments) {
  if (!arguments.occupy.empty()) return Occupy(arguments);
  if (arguments.rendered == !arguments.sequence.empty()) {
    return console::Fail(kLatencyCommand, InvalidArgument("name a sequence, or ask for --rendered"), kExitUsage);
  }
  UseOneHeap();
  // What can be wrong with the arguments is said before anything is read or rendered.
  std::optional<Requirement> requirement;
  if (!arguments.require.empty()) {
    const Result<Requirement> loaded = LoadRequirement(arguments.require);
    if (!loaded.ok()) return console::Fail(kLatencyCommand, loaded.status());
    requirement = *loaded;
  }
  // So long as asked for; else as the requirement needs, with room for a dropped frame; else a minute.
  const double asked_frames = requirement ? requirement->limits.back().value_or(0.0) : 0.0;
  const bool ends_by_count = arguments.seconds == 0.0 && asked_frames >= 1;
  const double stated_s = arguments.seconds > 0.0 ? arguments.seconds : kDefaultSeconds;
  if (!ends_by_count && stated_s <= arguments.warm_up_s) {
    char text[120];
    std::snprintf(text, sizeof(text), "--seconds %g leaves nothing after --warm-up %g; give more, or a shorter warm-up",
                  stated_s, arguments.warm_up_s);
    return console::Fail(kLatencyCommand, InvalidArgument(text), kExitUsage);
  }
  const Result<ConfigStore<EngineConfig>> loaded = LoadEngineConfig(arguments.config, arguments.assignments);
  if (!loaded.ok()) return console::Fail(kLatencyCommand, loaded.status(), kExitConfig);
  const EngineConfig& config = loaded->config();
  if (!arguments.out.empty()) {
    const Status status = OutputFolder::Check(arguments.out, kLatencyContent, arguments.overwrite);
    if (!status.ok()) return console::FailWriting(kLatencyCommand, status);
  }

  const Result<std::unique_ptr<LoopedSource>> source = LoadFrames(arguments);
  if (!source.ok()) return console::Fail(kLatencyCommand, source.status());
  const CameraCalibration& calibration = (*source)->calibration();
  const Result<CameraModel> camera = CameraModel::Create(calibration);
  if (!camera.ok()) return console::Fail(kLatencyCommand, camera.status());
  const int num_threads = NumVisionThreads(arguments.threads, config, Engine::Mode::kRealTime);
  const Result<MemoryPlan> plan = PlanMemory(config, calibration, arguments.device, num_threads);
  if (!plan.ok()) return console::Fail(kLatencyCommand, plan.status());
  if (const Status status = CheckMemory(*plan, config, AvailableHostMemory()); !status.ok())
    return console::Fail(kLatencyCommand, status);
  const Result<std::unique_ptr<VisionDevice>> device =
      CreateVisionDevice(arguments.device, config, calibration, num_threads);
  if (!device.ok()) return console::Fail(kLatencyCommand, device.status());
  if (const Status status = (*device)->SetStaticMask((*source)->static_mask()); !status.ok())
    return console::Fail(kLatencyCommand, status);
  if (const Result<int> warm = WarmUp(**device, **source); !warm.ok()) {
    return console::Fail(kLatencyCommand, warm.status());
  }
  const Result<std::unique_ptr<const Vocabulary>> vocabulary = LoadVocabularyFor(config);
  if (!vocabulary.ok()) return console::Fail(kLatencyCommand, vocabulary.status());
  const Result<DepthSearch> depth = CreateDepthSearch(arguments.device, config, *camera, (*source)->static_mask());
  if (!depth.ok()) return console::Fail(kLatencyCommand, depth.status());
  const SystemClock clock;
  Engine engine(config, *camera, **device, Engine::Mode::kRealTime, &clock, (*source)->static_mask(), vocabulary->get(),
                depth->matcher.get());

  Result<Load> load = MakeLoad(arguments, calibration, (*device)->is_accelerator());
  if (!load.ok()) return console::Fail(kLatencyCommand, load.status());

  const double rate_hz = (calibration.rate_hz > 0 ? calibration.rate_hz : 25.0) * arguments.rate;
  const auto warm_up_frames = static_cast<std::uint32_t>(std::ceil(arguments.warm_up_s * rate_hz));
  const double seconds = ends_by_count ? arguments.warm_up_s + 1.05 * asked_frames / rate_hz + 5.0 : stated_s;
  std::atomic<bool> stop{false};
  const std::atomic<bool>& stop_requested = CatchStopSignals();
  // From when frames come: locking memory and starting threads takes none of the time that was asked for.
  TimePoint begin;
  std::optional<MeasuringTimer> timer;
  const auto start_timer = [&] {
    begin = clock.Now();
    timer.emplace(clock, begin, seconds, stop_requested, &stop);
  };
  LatencyRecord record(warm_up_frames, static_cast<std::size_t>(std::lround(arguments.trace_s * rate_hz)),
                       ends_by_count ? static_cast<std::uint64_t>(asked_frames) : 0, start_timer,
                       [&stop] { stop = true; });

  LatencyReport report;
  report.title = "haustra latency " + (arguments.rendered ? std::string("(rendered)") : arguments.sequence);
  report.settings = {{"device", DeviceText(**device, num_threads)},
                     {"picture", std::to_string(calibration.width_px) + "x" + std::to_string(calibration.height_px) +
                                     ", " + std::to_string((*source)->num_loaded()) + " frames there and back again (" +
                                     std::to_string((*source)->num_bytes() >> 20) + " MB)"},
                     {"rate", std::to_string(rate_hz).substr(0, 6) + " Hz"},
                     {"load", LoadText(*load)}};
  report.deadline_ms = config.scheduler.deadline_ms > 0 ? config.scheduler.deadline_ms : 1e3 / rate_hz;
  report.board_before = ReadBoardState("");
  report.record = &record;
  std::optional<OutputFolder> output;
  if (!arguments.out.empty()) {
    Result<OutputFolder> created = OutputFolder::Create(arguments.out, kLatencyContent, arguments.overwrite);
    if (!created.ok()) return console::FailWriting(kLatencyCommand, created.status());
    output.emplace(std::move(created).value());
  }
  console::Note(kLatencyCommand, "measuring for %.0f s", seconds);

  RealTimeOptions options;
  options.rate = arguments.rate;
  options.rt = config.rt;
  Result<SessionSummary> session = SessionSummary();
  {
    const Stress stress(load->threads, std::move(load->device));
    session = RunRealTime(**source, engine, clock, options, record, stop);
    timer.reset();
  }
  const double measured_s = ToSeconds(clock.Now() - begin);
  if (!session.ok()) return console::Fail(kLatencyCommand, session.status());
  // What was measured until then is good, and says of how long it is.
  std::string stopped;
  if (stop_requested) {
    char text[80];
    std::snprintf(text, sizeof(text), "stopped after %.1f of %.1f s", measured_s, seconds);
    stopped = text;
    report.settings.push_back({"length", stopped});
  }
  if (record.num_measured() == 0) {
    if (output) output->Discard();
    if (!stopped.empty()) return console::Fail(kLatencyCommand, Status(StatusCode::kCancelled, stopped));
    return console::Fail(kLatencyCommand, NothingMeasured(record, seconds));
  }
  report.board_after = ReadBoardState("");
  if (requirement) report.verdict = Judge(*requirement, record.Values());
  console::Print("%s", ToText(report).c_str());
  if (!arguments.out.empty()) {
    if (const Status status = WriteResults(arguments.out, report); !status.ok()) {
      return console::FailWriting(kLatencyCommand, status);
    }
    output->Commit();
    console::Tell("  results in         %s (latency.html, latency.json, histogram.txt, trace.json)\n",
                  arguments.out.c_str());
  }
  if (record.realtime()) {
    for (const std::string& refusal : Refusals(*record.realtime())) {
      console::Warn(kLatencyCommand, "%s", refusal.c_str());
    }
  }
  if (!stopped.empty()) return console::Fail(kLatencyCommand, Status(StatusCode::kCancelled, stopped));
  return report.is_met() ? kExitOk : kExitNotMet;
}

}  // namespace

void AddLatencyCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<LatencyArguments>();
  CLI::App* command = app.add_subcommand("latency", "Measure latency in real time, and judge it by a requirement");
  command->add_option("sequence", arguments->sequence, "Sequence to play there and back again (see run)");
  command->add_flag("--rendered", arguments->rendered, "Play a colon rendered for the purpose instead");
  command->add_option("--out", arguments->out, "Folder for latency.html, latency.json, histogram.txt and trace.json");
  AddOverwriteFlag(*command, arguments->overwrite);
  std::string keys = "YAML file of limits; exit code 1 when one is not met. Keys:";
  for (const RequirementKey& key : kRequirementKeys) {
    keys += "\n  " + std::string(key.name) + (key.is_minimum ? " (at least): " : ": ") + std::string(key.meaning);
  }
  command->add_option("--require", arguments->require, keys);
  command->add_option("--seconds", arguments->seconds, "How long; default: as --require needs, else 60")
      ->check(NumberBetween(0.1, 86400.0));
  command->add_option("--rate", arguments->rate, "Pace relative to the camera")
      ->check(NumberBetween(0.01, 100.0))
      ->capture_default_str();
  command->add_option("--warm-up", arguments->warm_up_s, "Seconds at the start that do not count")
      ->check(NumberBetween(0.0, 600.0))
      ->capture_default_str();
  command->add_option("--loop", arguments->loop_s, "Seconds of the sequence that are held in memory and played")
      ->check(NumberBetween(0.2, 600.0))
      ->capture_default_str();
  command->add_option("--trace", arguments->trace_s, "Seconds at the end that trace.json shows")
      ->check(NumberBetween(0.0, 600.0))
      ->capture_default_str();
  command->add_flag("--stress", arguments->stress, "Load on all cores, the memory, and the GPU where it is used");
  command->add_option("--stress-cpu", arguments->stress_cpu, "Threads of arithmetic")
      ->transform(WholeNumberBetween(0, 1024));
  command->add_option("--stress-memory", arguments->stress_memory, "Threads that copy memory")
      ->transform(WholeNumberBetween(0, 256));
  command->add_flag("--stress-gpu", arguments->stress_gpu, "A second user of the vision device, of low priority");
  command->add_flag("--stress-gpu-process", arguments->stress_process,
                    "The same in a process of its own, as a compositor or an encoder has");
  command->add_option("--occupy", arguments->occupy, "Be that process: WIDTHxHEIGHT")->group("");
  AddConfigurationOptions(*command, *arguments);
  AddFrameRateOption(*command, arguments->part.frame_rate_hz);
  AddDeinterlaceOption(*command, arguments->part.deinterlace);
  command->add_flag("--halve", arguments->part.halve, "Halve the resolution by averaging 2x2 pixels");
  command->callback([arguments, &action] { action = [arguments] { return Measure(*arguments); }; });
}

}  // namespace haustra
