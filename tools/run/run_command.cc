#include "tools/run/run_command.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

#include "capture/calibration_reader.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/open_sequence.h"
#include "capture/v4l2/v4l2_options.h"
#include "capture/video_source.h"
#include "engine/engine.h"
#include "engine/io/atlas_format.h"
#include "platform/assemble.h"
#include "platform/atlas_file.h"
#include "platform/clock/system_clock.h"
#include "platform/config/engine_config_table.h"
#include "platform/memory_plan.h"
#include "platform/realtime/one_heap.h"
#include "platform/session/session.h"
#include "platform/session/warm_up.h"
#include "platform/trap/allocation_trap.h"
#include "platform/vocabulary_loader.h"
#include "tools/calibrate/calibration_text.h"
#include "tools/calibrate/clip_calibration.h"
#include "tools/command/common_options.h"
#include "tools/command/configuration_options.h"
#include "tools/command/console.h"
#include "tools/command/missing_calibration.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"
#include "tools/report/run_report.h"
#include "tools/run/map_motion.h"
#include "tools/run/mark_file.h"
#include "tools/run/mark_log.h"
#include "tools/run/progress.h"
#include "tools/run/run_outputs.h"
#include "tools/run/scene_depth.h"
#include "tools/run/surface_of_run.h"
#include "tools/run/two_views.h"

namespace haustra {
namespace {

constexpr const char* kRunCommand = "run";

struct RunArguments : ConfigurationOptions {
  std::string sequence;
  std::string out;
  std::string mode = "sequential";
  double rate = 1.0;
  std::optional<std::uint64_t> seed;
  SequenceOptions part;  // of the sequence, with calibration and mask
  bool overwrite = false;
  std::string surface = "auto";
  std::string report = "on";
  std::string load_atlas;
  std::string save_atlas;
  std::string marks;
  std::string trap_allocations = "off";
  bool print_config = false;
};

// Colours of the points of all maps, from a second reading of the frames that became keyframes.
class ColourReader {
 public:
  Status Read(const std::string& sequence, const SequenceOptions& options, const Engine& engine) {
    std::set<std::uint32_t> wanted;
    engine.atlas().keyframes().ForEach([&](KeyframeHandle, const Keyframe& k) {
      if (k.session == engine.atlas().session()) wanted.insert(k.frame_index);
    });
    if (wanted.empty()) return Status::Ok();
    HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(sequence, options));
    while (true) {
      const Result<Frame> frame = source->Next(kNoDeadline);
      if (frame.code() == StatusCode::kDataLoss) continue;
      if (!frame.ok()) break;
      if (wanted.count(frame->index) != 0) Keep(*frame);
      if (frame->index >= *wanted.rbegin()) break;
    }
    return Status::Ok();
  }

  std::array<std::uint8_t, 3> operator()(std::uint32_t frame_index, const Eigen::Vector2d& pixel) const {
    const auto it = images_.find(frame_index);
    if (it == images_.end()) return {128, 128, 128};
    const Small& image = it->second;
    const int x = std::clamp(static_cast<int>(pixel.x()) / kStep, 0, image.width - 1);
    const int y = std::clamp(static_cast<int>(pixel.y()) / kStep, 0, image.height - 1);
    return image.rgb[static_cast<std::size_t>(y) * image.width + x];
  }

 private:
  static constexpr int kStep = 4;  // a quarter of the resolution is plenty for the colour of a point
  struct Small {
    int width = 0;
    int height = 0;
    std::vector<std::array<std::uint8_t, 3>> rgb;
  };

  void Keep(const Frame& frame) {
    Small small;
    small.width = (frame.image.width + kStep - 1) / kStep;
    small.height = (frame.image.height + kStep - 1) / kStep;
    const int bytes = BytesPerPixel(frame.image.format);
    for (int y = 0; y < frame.image.height; y += kStep) {
      for (int x = 0; x < frame.image.width; x += kStep) {
        const std::uint8_t* p = frame.image.row(y) + x * bytes;
        small.rgb.push_back(bytes == 1 ? std::array<std::uint8_t, 3>{p[0], p[0], p[0]}
                                       : std::array<std::uint8_t, 3>{p[2], p[1], p[0]});
      }
    }
    images_[frame.index] = std::move(small);
  }

  std::map<std::uint32_t, Small> images_;
};

Status CheckPace(const RunArguments& arguments) {
  if (IsV4l2Spec(arguments.sequence) && (arguments.mode != "realtime" || arguments.rate != 1.0)) {
    return InvalidArgument("a camera does not wait: --mode realtime, and no --rate");
  }
  if (arguments.mode != "realtime" && arguments.rate != 1.0) {
    return InvalidArgument("--rate is the pace of real time: it needs --mode realtime");
  }
  return Status::Ok();
}

Result<ClipCalibration> EstimateCalibration(const RunArguments& arguments, std::uint64_t seed, const Status& error) {
  console::Note(kRunCommand, "%s; estimating it from the clip itself", error.message().c_str());
  ClipCalibrationRequest request;
  request.sequence = arguments.sequence;
  request.options = arguments.part;
  request.options.every_nth = 1;
  request.device = arguments.device;
  request.threads = arguments.threads;
  request.seed = seed;
  Result<ClipCalibration> result = CalibrateFromClip(request);
  if (result.ok() && result->estimate.verdict.ok()) {
    if (!console::IsQuiet()) std::fputs(CalibrationText(*result).c_str(), stderr);
  } else if (result.ok()) {
    console::Note(kRunCommand, "it cannot be estimated: %s", result->estimate.verdict.message().c_str());
  }
  if (result.ok()) return result;
  // What is missing is still the calibration.
  return Status(error.code(),
                error.message() + ".\nIt cannot be estimated: " + result.status().message() +
                    ".\nGive one with --calibration FILE (config/cameras has published ones), or estimate "
                    "it from a better clip of the same camera: haustra calibrate CLIP --out FILE");
}

struct RunInput {
  std::unique_ptr<FrameSource> source;
  SequenceOptions options;                   // with the calibration that was estimated
  std::optional<ClipCalibration> estimated;  // for want of one
  std::string guess;                         // what a reader must know of the calibration; empty: nothing
};

// A sequence that has no calibration is opened with one that is estimated from it.
Result<RunInput> OpenInput(const RunArguments& arguments, std::uint64_t seed) {
  RunInput input;
  input.options = arguments.part;
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(arguments.sequence, input.options);
  if (!source.ok()) {
    HAUSTRA_TRY(ApartFromCalibration(source.status(), arguments.sequence, arguments.part));
    HAUSTRA_ASSIGN(input.estimated, EstimateCalibration(arguments, seed, source.status()));
    input.options.calibration = input.estimated->calibration;
    source = OpenSequence(arguments.sequence, input.options);
  }
  HAUSTRA_ASSIGN(input.source, std::move(source));
  // In pixels of the frames as they are stored, where it was guessed from them.
  input.guess = GuessText(input.estimated ? input.estimated->calibration : input.source->calibration());
  return input;
}

void WarnOfInput(const std::string& sequence, const RunInput& input) {
  if (IsCutRecording(sequence)) {
    console::Warn(kRunCommand, "%s: the recording was cut; the frames are those that were whole by then",
                  sequence.c_str());
  }
  if (!input.guess.empty()) console::Warn(kRunCommand, "%s", input.guess.c_str());
  // A camera's pictures come once.
  if (IsV4l2Spec(sequence)) return;
  const std::string two_views = TwoViewsRemark(sequence, input.options);
  if (!two_views.empty()) console::Warn(kRunCommand, "%s", two_views.c_str());
}

// How the heap of the tracking thread is watched; null: not at all.
Result<const ThreadWatch*> HeapWatchOf(const RunArguments& arguments) {
  if (arguments.trap_allocations == "off") return nullptr;
  if (!AllocationTrap::IsAvailable()) {
    return Unavailable("--trap-allocations: this build's malloc cannot be watched (sanitizer, or not glibc)");
  }
  return arguments.trap_allocations == "abort" ? &AbortingHeapWatch() : &CountingHeapWatch();
}

// Before anything is read: what is there already is no surprise after the procedure.
Status CheckOutputs(const RunArguments& arguments) {
  HAUSTRA_TRY(OutputFolder::Check(arguments.out, kRunContent, arguments.overwrite));
  const SequenceOptions& part = arguments.part;
  HAUSTRA_TRY(CheckInputsOutside(arguments.out, {arguments.sequence, part.calibration_path, part.mask_path,
                                                 arguments.marks, arguments.config, arguments.load_atlas}));
  if (arguments.save_atlas.empty()) return Status::Ok();
  // The atlas that was loaded may be replaced: that is how one grows from procedure to procedure.
  return CheckOutputFile(
      arguments.save_atlas, {"an atlas of haustra", {kAtlasFileKind.magic}}, arguments.overwrite,
      {arguments.sequence, part.calibration_path, part.mask_path, arguments.marks, arguments.config});
}

// The surface of a run that kept depth, beside its results, which are good without it. What it says of the wall goes
// into the summary, on the disk, too, which is whole at any time.
Status WriteSurface(const RunArguments& arguments, const Engine& engine, const std::atomic<bool>& stop,
                    RunSummary* summary) {
  if (arguments.surface == "off" || engine.depths() == nullptr) return Status::Ok();
  console::Note(kRunCommand, "making the surface of the wall");
  surface::SurfaceOptions options;
  options.num_threads = arguments.threads;
  options.stop = &stop;
  const Status made = MakeSurfaceOfRun(arguments.out, options, &summary->surface.emplace());
  const Status told = WriteSummary(arguments.out, *summary);
  if (made.ok()) return told;
  if (made.code() == StatusCode::kCancelled) {
    console::Warn(kRunCommand, "there is no surface: %s", summary->surface->why_not.c_str());
    return told;
  }
  return Status(made.code(), "there is no surface: " + made.message() + "; the other results are whole");
}

// The page beside the results; empty, and a warning, when there is none. The results are good without it.
std::string WriteReport(const RunArguments& arguments) {
  report::ReportRequest request;
  request.run = arguments.out;
  if (!IsV4l2Spec(arguments.sequence)) {
    request.pictures.sequence = arguments.sequence;
    request.pictures.deinterlace = arguments.part.deinterlace;
  }
  Result<std::string> page = report::MakeRunReport(request);
  if (!page.ok() && !request.pictures.sequence.empty()) {
    console::Warn(kRunCommand, "the report has no pictures: %s", page.status().message().c_str());
    request.pictures.sequence.clear();
    page = report::MakeRunReport(request);
  }
  const std::string path = arguments.out + "/report.html";
  const Status status = page.ok() ? WriteFile(path, *page) : page.status();
  if (status.ok()) return path;
  console::Warn(kRunCommand, "there is no report: %s", status.message().c_str());
  return {};
}

int EndWithoutFrames(const RunArguments& arguments, const Status& session, bool is_stopped) {
  if (!session.ok()) return console::Fail(kRunCommand, session);
  if (is_stopped) {
    console::Warn(kRunCommand, "stopped before the first frame; nothing is written");
    return kExitStopped;
  }
  // How long a recording is shows only when it has been read: of it, too, a part that is empty is a mistake.
  return console::Fail(kRunCommand, InvalidArgument(arguments.sequence + ": the sequence is empty from frame " +
                                                    std::to_string(arguments.part.first_frame) + " on"));
}

// What was asked for, beside what came of it.
void DescribeRequest(const RunArguments& arguments, const RunInput& input, std::uint64_t seed, RunSummary* summary) {
  summary->mode = arguments.mode;
  summary->device = arguments.device;
  summary->seed = seed;
  summary->first_frame = arguments.part.first_frame;
  summary->every_nth = arguments.part.every_nth;
  summary->rate = arguments.rate;
  if (input.estimated) {
    summary->calibration_json = CalibrationJson(*input.estimated).dump();
  } else if (!input.guess.empty()) {
    summary->calibration_json = nlohmann::ordered_json{{"source", "given"}, {"note", input.guess}}.dump();
  }
}

// Damaged frames and refused marks.
void WarnOfLeftOut(const RunRecord& record, const RunSummary& summary) {
  for (const RunEvent& event : record.events()) {
    if (event.event == "frame_damaged") console::Warn(kRunCommand, "%s", event.details.c_str());
  }
  for (const RefusedMark& mark : summary.refused_marks) {
    console::Warn(kRunCommand, "mark %s in frame %u is refused: %s", mark.label.c_str(), mark.frame_index,
                  mark.reason.c_str());
  }
}

int Run(const RunArguments& arguments) {
  if (const Status status = CheckPace(arguments); !status.ok()) {
    return console::Fail(kRunCommand, status, kExitUsage);
  }
  if (arguments.mode == "realtime") UseOneHeap();
  const Result<ConfigStore<EngineConfig>> loaded = LoadEngineConfig(arguments.config, arguments.assignments);
  if (!loaded.ok()) return console::Fail(kRunCommand, loaded.status(), kExitConfig);
  if (arguments.print_config) {
    console::Print("%s", loaded->Print().c_str());
    return kExitOk;
  }
  if (arguments.sequence.empty() || arguments.out.empty()) {
    return console::Fail(kRunCommand, InvalidArgument("SEQUENCE and --out are required"), kExitUsage);
  }
  const NamedOutput atlas{"--save-atlas", arguments.save_atlas};
  if (const Status status = CheckNotOfFolder(atlas, arguments.out, kRunContent); !status.ok()) {
    return console::Fail(kRunCommand, status, kExitUsage);
  }
  if (const Status status = CheckOutputs(arguments); !status.ok()) return console::FailWriting(kRunCommand, status);
  EngineConfig config = loaded->config();
  if (arguments.seed) config.seed = *arguments.seed;

  // Before the input: a camera that is to be estimated takes minutes.
  const Result<std::unique_ptr<const Vocabulary>> vocabulary = LoadVocabularyFor(config);
  if (!vocabulary.ok()) return console::Fail(kRunCommand, vocabulary.status());
  std::vector<MarkRequest> mark_requests;
  if (!arguments.marks.empty()) {
    Result<std::vector<MarkRequest>> read = ReadMarkFile(arguments.marks);
    if (!read.ok()) return console::Fail(kRunCommand, read.status());
    mark_requests = std::move(read).value();
  }
  if (!arguments.load_atlas.empty()) {
    const Status status = CheckAtlasFileCanBeLoaded(arguments.load_atlas);
    if (!status.ok()) return console::Fail(kRunCommand, status);
  }
  const Result<RunInput> input = OpenInput(arguments, config.seed);
  if (!input.ok()) return console::Fail(kRunCommand, input.status());
  WarnOfInput(arguments.sequence, *input);
  FrameSource& source = *input->source;
  const CameraCalibration& calibration = source.calibration();
  const Result<CameraModel> camera = CameraModel::Create(calibration);
  if (!camera.ok()) return console::Fail(kRunCommand, camera.status());
  const Result<const ThreadWatch*> thread_watch = HeapWatchOf(arguments);
  if (!thread_watch.ok()) return console::Fail(kRunCommand, thread_watch.status());
  const bool is_realtime = arguments.mode == "realtime";
  const Engine::Mode mode = is_realtime ? Engine::Mode::kRealTime : Engine::Mode::kSequential;
  const int num_threads = NumVisionThreads(arguments.threads, config, mode);
  const Result<MemoryPlan> plan = PlanMemory(config, calibration, arguments.device, num_threads);
  if (!plan.ok()) return console::Fail(kRunCommand, plan.status());
  if (const Status status = CheckMemory(*plan, config, AvailableHostMemory()); !status.ok())
    return console::Fail(kRunCommand, status);
  Result<std::unique_ptr<VisionDevice>> device = CreateVisionDevice(arguments.device, config, calibration, num_threads);
  if (!device.ok()) return console::Fail(kRunCommand, device.status());
  if (const Status status = (*device)->SetStaticMask(source.static_mask()); !status.ok())
    return console::Fail(kRunCommand, status);

  const Result<DepthSearch> depth = CreateDepthSearch(arguments.device, config, *camera, source.static_mask());
  if (!depth.ok()) return console::Fail(kRunCommand, depth.status());

  if (is_realtime) {
    if (const Result<int> warm = WarmUp(**device, source); !warm.ok()) {
      return console::Fail(kRunCommand, warm.status());
    }
  }
  const bool is_live = IsV4l2Spec(arguments.sequence);
  const SystemClock clock;
  Engine engine(config, *camera, **device, mode, &clock, source.static_mask(), vocabulary->get(), depth->matcher.get());
  if (!arguments.load_atlas.empty()) {
    if (const Status status = LoadAtlasFile(arguments.load_atlas, &engine); !status.ok())
      return console::Fail(kRunCommand, status);
  }

  // Better now than after the procedure.
  if (!arguments.save_atlas.empty()) {
    const Status status = CheckAtlasFileCanBeSaved(arguments.save_atlas);
    if (!status.ok()) return console::FailWriting(kRunCommand, status);
  }
  // Last of the checks: an earlier run's results in the folder are touched only when this run can start.
  Result<OutputFolder> output = OutputFolder::Create(arguments.out, kRunContent, arguments.overwrite);
  if (!output.ok()) return console::FailWriting(kRunCommand, output.status());
  if (const Status status = MakeResultFolders(arguments.out); !status.ok()) {
    return console::FailWriting(kRunCommand, status);
  }
  const std::uint32_t num_frames = source.num_frames();
  console::Note(kRunCommand, "%s, %s frames %dx%d, %s mode, device %s", arguments.sequence.c_str(),
                (num_frames > 0 ? std::to_string(num_frames) : "an unknown number of").c_str(), calibration.width_px,
                calibration.height_px, arguments.mode.c_str(), DeviceText(**device, num_threads).c_str());

  const std::atomic<bool>& stop_requested = CatchStopSignals();
  Progress progress(num_frames);
  RunRecord record([&progress](const RunRecord& r) { progress.Update(r); }, *thread_watch);
  record.ExpectFrames(num_frames);
  RealTimeOptions options;
  options.rate = arguments.rate;
  options.rt = config.rt;
  MarkLog marks(engine, mark_requests, arguments.part);
  options.hooks = &marks;
  const Result<SessionSummary> session = is_realtime
                                             ? RunRealTime(source, engine, clock, options, record, stop_requested)
                                             : RunSequential(source, engine, clock, record, stop_requested, marks);
  marks.Finish();
  progress.Finish(record);
  const std::string remark = StampRemark(source);
  if (!remark.empty()) console::Warn(kRunCommand, "%s", remark.c_str());
  engine.FinishDepth(stop_requested);
  // Nothing has come of it: an earlier run is worth more.
  if (record.frames().empty()) {
    output->Discard();
    return EndWithoutFrames(arguments, session.status(), stop_requested);
  }
  if (stop_requested && !is_live) {
    console::Warn(kRunCommand, "stopped after %zu frames; what was mapped until then is written",
                  record.frames().size());
  }
  Status calibration_written;
  if (input->estimated) {
    calibration_written = WriteCalibration(arguments.out + "/calib.yaml", input->estimated->calibration);
  }
  // A file that cannot be written costs none of the others.
  Status atlas_saved;
  if (!arguments.save_atlas.empty()) atlas_saved = SaveAtlasFile(engine, arguments.save_atlas);
  // Whatever ended the session, what was mapped until then is written.
  const std::vector<FinalPose> poses = ResolveAll(record, engine);
  // What a container says about its length is a guess: a sequence that was seen to its end is as long as that.
  const bool is_aborted = !session.ok() || stop_requested;
  RunSummary summary =
      Summarise(record, poses, engine, session.ok() ? *session : SessionSummary{}, is_aborted ? num_frames : 0);
  SummariseMarks(marks, engine, &summary);
  summary.motions = FindMapMotions(record, poses, engine);
  summary.scene_depths = FindSceneDepths(engine.atlas());
  DescribeRequest(arguments, *input, config.seed, &summary);
  ColourReader colours;
  // What a camera has shown cannot be looked at again.
  if (const Status status = is_live ? Status::Ok() : colours.Read(arguments.sequence, input->options, engine);
      !status.ok()) {
    console::Warn(kRunCommand, "the points of the maps stay grey: %s", status.message().c_str());
  }
  const Status written = WriteOutputs(arguments.out, record, poses, summary, engine, marks, source,
                                      !arguments.part.mask_path.empty(), std::ref(colours));
  if (!written.ok()) {
    if (!calibration_written.ok()) console::Warn(kRunCommand, "%s", calibration_written.message().c_str());
    const std::string earlier = output->PutBack();
    if (!earlier.empty()) console::Warn(kRunCommand, "earlier results are in %s", earlier.c_str());
    return console::FailWriting(kRunCommand, written);
  }
  output->Commit();
  WarnOfLeftOut(record, summary);
  // What ended the session, as that of a camera ends, does not end this, too.
  const std::atomic<bool>& stop_surface = stop_requested ? SecondStopSignal() : stop_requested;
  const Status surface = WriteSurface(arguments, engine, stop_surface, &summary);
  const std::string page = arguments.report == "on" ? WriteReport(arguments) : std::string();
  console::Tell("%s\n%s  results in    %s\n", arguments.sequence.c_str(), ToText(summary).c_str(),
                arguments.out.c_str());
  if (!page.empty()) console::Tell("  report        %s\n", page.c_str());
  if (!calibration_written.ok() && !atlas_saved.ok()) {
    console::Warn(kRunCommand, "%s", atlas_saved.message().c_str());
  }
  if (!calibration_written.ok()) return console::FailWriting(kRunCommand, calibration_written);
  if (!atlas_saved.ok()) return console::FailWriting(kRunCommand, atlas_saved);
  if (!surface.ok()) return console::FailWriting(kRunCommand, surface);
  if (!session.ok()) return console::Fail(kRunCommand, session.status());
  return kExitOk;
}

}  // namespace

void AddRunCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Map a sequence: folder of frames, data set or video");
  // Both are required, but not to print the configuration.
  command->add_option("sequence", arguments->sequence,
                      "Folder with frames/, times.txt, calib.yaml, or of pictures; C3VD, EuRoC, TUM; video; a camera: "
                      "v4l2:/dev/video0[,size=1440x1080,...] (haustra capture lists cameras and options)");
  command->add_option("--out", arguments->out, "Folder for the results (made when missing)");
  AddOverwriteFlag(*command, arguments->overwrite);
  command
      ->add_option("--surface", arguments->surface,
                   "auto: a run that kept depth (depth.enabled) makes the surface of the wall, OUT/surface")
      ->check(CLI::IsMember({"auto", "off"}))
      ->capture_default_str();
  command->add_option("--report", arguments->report, "on: ends with the page OUT/report.html")
      ->check(CLI::IsMember({"on", "off"}))
      ->capture_default_str();
  command->add_flag("--print-config", arguments->print_config,
                    "Prints the configuration with the origin of each value, and ends");
  command
      ->add_option("--mode", arguments->mode,
                   "sequential: every frame, repeats to the bit; realtime: at the camera's pace")
      ->check(CLI::IsMember({"sequential", "realtime"}))
      ->capture_default_str();
  command->add_option("--rate", arguments->rate, "Pace of real-time mode relative to the camera (0.5: half as fast)")
      ->check(NumberBetween(0.01, 100.0))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "Seed of all random sampling (default: the configuration's)")
      ->transform(WholeNumber<std::uint64_t>());
  AddConfigurationOptions(*command, *arguments);
  AddFrameRangeOptions(*command, arguments->part);
  AddFrameRateOption(*command, arguments->part.frame_rate_hz);
  command->add_option("--calibration", arguments->part.calibration_path,
                      "Camera calibration to use instead of the sequence's own (see config/cameras)");
  command->add_option("--mask", arguments->part.mask_path,
                      "Static mask to use instead of the sequence's own (255 inside)");
  command->add_option("--load-atlas", arguments->load_atlas,
                      "Maps of an earlier run with the same camera, to be recognised and joined");
  command->add_option("--marks", arguments->marks,
                      "Places to mark, a table frame,u,v,label, as the recording has frames and pixels; where they are "
                      "seen goes to OUT/marks.csv");
  command->add_option("--save-atlas", arguments->save_atlas, "File for all maps at the end of the run");
  command
      ->add_option("--trap-allocations", arguments->trap_allocations,
                   "Watch the tracking thread's use of the heap: count it, or abort with a backtrace at the first")
      ->check(CLI::IsMember({"off", "count", "abort"}))
      ->capture_default_str();
  AddDeinterlaceOption(*command, arguments->part.deinterlace);
  command->add_flag("--halve", arguments->part.halve, "Halve the resolution by averaging 2x2 pixels");
  command->callback([arguments, &action] { action = [arguments] { return Run(*arguments); }; });
}

}  // namespace haustra
