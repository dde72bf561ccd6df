#include "tools/capture/capture_command.h"

#include <atomic>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "capture/v4l2/device_list.h"
#include "capture/v4l2/v4l2_source.h"
#include "tools/capture/sequence_recorder.h"
#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/command/sequence_content.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

constexpr const char* kCaptureCommand = "capture";

struct CaptureArguments {
  std::string camera;
  std::string out;
  double seconds = 0.0;
  std::uint32_t num_frames = 0;
  bool is_dry = false;
  bool overwrite = false;
  std::string store;
  bool halve = false;
  DeinterlaceChoice deinterlace = DeinterlaceChoice::kAuto;  // where pictures are halved
  std::string calibration;
  std::string mask;
};

void PrintFormat(const V4l2FormatInfo& format) {
  if (format.sizes.empty()) console::Print("  %s\n", FourccText(format.fourcc).c_str());
  for (const V4l2FormatInfo::Size& size : format.sizes) {
    console::Print("  %s %s%dx%d", FourccText(format.fourcc).c_str(), size.step_px > 0 ? "up to " : "", size.width_px,
                   size.height_px);
    for (std::size_t i = 0; i < size.rates_hz.size(); ++i)
      console::Print("%s%.4g", i == 0 ? "  " : ", ", size.rates_hz[i]);
    console::Print("%s\n", size.rates_hz.empty() ? "" : " Hz");
  }
}

void PrintFormats(const std::vector<V4l2FormatInfo>& formats) {
  std::string others;
  for (const V4l2FormatInfo& format : formats) {
    if (format.is_readable) {
      PrintFormat(format);
    } else {
      others += " " + FourccText(format.fourcc);
    }
  }
  if (!others.empty()) console::Print("  not read here:%s\n", others.c_str());
}

int List() {
  std::vector<std::string> unreadable;
  const std::vector<V4l2DeviceInfo> devices = ListV4l2Devices(SystemDeviceIo(), &unreadable);
  for (const V4l2DeviceInfo& device : devices) {
    console::Print("%s  %s (%s, %s)\n", device.path.c_str(), device.name.c_str(), device.bus.c_str(),
                   device.driver.c_str());
    for (std::size_t i = 0; i < device.inputs.size(); ++i)
      console::Print("  input %zu: %s\n", i, device.inputs[i].c_str());
    PrintFormats(device.formats);
  }
  for (const std::string& message : unreadable) console::Warn(kCaptureCommand, "%s", message.c_str());
  return devices.empty() ? console::Fail(kCaptureCommand, Unavailable("there is no camera")) : kExitOk;
}

// What came of the camera, a line each.
std::string CountsText(const V4l2Counters& counters, std::uint64_t num_frames, double seconds) {
  const auto line = [](const char* name, std::uint64_t count, const char* what) {
    char text[120];
    std::snprintf(text, sizeof(text), "%-13s %llu%s\n", name, static_cast<unsigned long long>(count), what);
    return std::string(text);
  };
  char rate[32];
  std::snprintf(rate, sizeof(rate), " (%.2f Hz)", num_frames > 1 ? static_cast<double>(num_frames - 1) / seconds : 0.0);
  std::string text = line("frames", num_frames, rate) + line("lost", counters.num_lost, " pictures of the camera") +
                     line("damaged", counters.num_damaged, "") +
                     line("left out", counters.num_left_out, " beyond the frame rate") +
                     line("restarts", counters.num_restarts, "");
  if (counters.num_unstamped > 0) {
    text += line("unstamped", counters.num_unstamped,
                 ": the driver gives no time on CLOCK_MONOTONIC, or one that cannot be");
  }
  return text;
}

// What MJPEG cameras send can be stored as it comes, unless it is changed on the way or PNG is asked for.
bool StoresEncoded(const CaptureArguments& arguments, const V4l2Options& camera) {
  return arguments.store != "png" && !arguments.halve && camera.region.is_whole();
}

struct Captured {
  std::uint64_t num_frames = 0;
  TimePoint first, last;
};

// Until the end that was asked for, a stop, or an error of the recorder, which may be null. A camera that goes is
// waited for.
Captured CaptureFrames(const CaptureArguments& arguments, bool stores_encoded, V4l2Source& source,
                       SequenceRecorder* recorder, const std::atomic<bool>& stop_requested) {
  DeviceIo& io = SystemDeviceIo();
  const TimePoint begin = io.Now();
  const auto limit = Duration(static_cast<std::int64_t>(arguments.seconds * 1e9));
  Captured captured;
  bool is_gone = false;
  const auto is_over = [&] {
    return stop_requested.load() || (arguments.num_frames > 0 && captured.num_frames >= arguments.num_frames) ||
           (arguments.seconds > 0.0 && io.Now() - begin >= limit) || (recorder != nullptr && !recorder->status().ok());
  };
  while (!is_over()) {
    const Result<Frame> frame = source.Next(io.Now() + std::chrono::milliseconds(200));
    if (frame.code() == StatusCode::kUnavailable) {
      if (!is_gone) console::Warn(kCaptureCommand, "%s; waiting for it", frame.status().message().c_str());
      is_gone = true;
    }
    if (frame.code() == StatusCode::kDataLoss) console::Warn(kCaptureCommand, "%s", frame.status().message().c_str());
    if (!frame.ok()) continue;
    if (is_gone) console::Note(kCaptureCommand, "%s", source.Describe().c_str());
    is_gone = false;
    if (captured.num_frames++ == 0) captured.first = frame->timestamp;
    captured.last = frame->timestamp;
    if (recorder == nullptr) continue;
    recorder->Add(*frame, stores_encoded ? source.encoded() : std::span<const std::uint8_t>());
  }
  return captured;
}

int Capture(const CaptureArguments& arguments) {
  if (arguments.camera.empty()) return List();
  const std::string spec =
      IsV4l2Spec(arguments.camera) ? arguments.camera : std::string(kV4l2Prefix) + arguments.camera;
  Result<V4l2Options> camera = ParseV4l2Spec(spec);
  if (!camera.ok()) return console::Fail(kCaptureCommand, camera.status(), kExitUsage);
  camera->skip_stale = false;
  SequenceOptions sequence;
  sequence.halve = arguments.halve;
  // What is stored as it came is deinterlaced when it is read. Halving would mix the fields for good.
  sequence.deinterlace = arguments.halve ? arguments.deinterlace : DeinterlaceChoice::kOff;
  sequence.calibration_path = arguments.calibration;
  sequence.mask_path = arguments.mask;
  if (arguments.out.empty() && !arguments.is_dry) {
    return console::Fail(kCaptureCommand,
                         InvalidArgument("--out names the folder for the recording (or --dry-run: none)"), kExitUsage);
  }
  if (!arguments.is_dry) {
    const Status status = OutputFolder::Check(arguments.out, kSequenceContent, arguments.overwrite);
    if (!status.ok()) return console::FailWriting(kCaptureCommand, status);
  }
  const Result<std::unique_ptr<V4l2Source>> opened = V4l2Source::Create(*camera, sequence, SystemDeviceIo());
  if (!opened.ok()) return console::Fail(kCaptureCommand, opened.status());
  V4l2Source& source = **opened;
  std::unique_ptr<SequenceRecorder> recorder;
  if (!arguments.is_dry) {
    SequenceRecorder::Options options;
    options.overwrite = arguments.overwrite;
    if (arguments.store == "jpg") options.store = SequenceRecorder::Store::kJpeg;
    Result<std::unique_ptr<SequenceRecorder>> created = SequenceRecorder::Create(
        arguments.out, options, arguments.calibration.empty() ? nullptr : &source.calibration(), source.static_mask());
    if (!created.ok()) return console::FailWriting(kCaptureCommand, created.status());
    recorder = std::move(*created);
  }
  console::Note(kCaptureCommand, "%s, frames of %dx%d at %.4g Hz", source.Describe().c_str(),
                source.calibration().width_px, source.calibration().height_px, source.calibration().rate_hz);

  const std::atomic<bool>& stop_requested = CatchStopSignals();
  const Captured captured =
      CaptureFrames(arguments, StoresEncoded(arguments, *camera), source, recorder.get(), stop_requested);
  if (stop_requested && (arguments.num_frames > 0 || arguments.seconds > 0.0)) {
    console::Warn(kCaptureCommand, "stopped before its end");
  } else if (stop_requested) {
    console::Note(kCaptureCommand, "stopped");
  }
  const std::string counts =
      CountsText(source.counters(), captured.num_frames, ToSeconds(captured.last - captured.first));
  if (recorder == nullptr) {
    console::Print("%s", counts.c_str());
    return kExitOk;
  }
  console::Tell("%s", counts.c_str());
  const Result<SequenceRecorder::Summary> written = recorder->Finish();
  if (!written.ok()) return console::FailWriting(kCaptureCommand, written.status());
  console::Tell("written       %u frames to %s\n", written->num_written, arguments.out.c_str());
  if (written->num_left_out > 0) {
    console::Warn(kCaptureCommand,
                  "%u frames are not written: this machine does not encode or store them fast enough; --store jpg, "
                  "--halve or a lower max-rate help",
                  written->num_left_out);
  }
  return kExitOk;
}

}  // namespace

void AddCaptureCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<CaptureArguments>();
  CLI::App* command = app.add_subcommand("capture", "List the cameras of this machine, or record one for replay");
  command->add_option(
      "camera", arguments->camera,
      "/dev/video0 or a part of the name, then options: ,size=1440x1080,rate=50,format=NV12,max-rate=25,"
      "input=NAME,region=WxH+X+Y,field=top|bottom,buffers=4,memory=mapped|dmabuf,wait=yes|no; "
      "without it: list the cameras");
  command->add_option("--out", arguments->out, "Folder for the recording");
  AddOverwriteFlag(*command, arguments->overwrite);
  command->add_option("--seconds", arguments->seconds, "Stop after that time; by default at Ctrl-C")
      ->check(PositiveNumber());
  command->add_option("--frames", arguments->num_frames, "Stop after that many frames")->check(PositiveNumber());
  command->add_flag("--dry-run", arguments->is_dry, "Write nothing, only count");
  command
      ->add_option("--store", arguments->store,
                   "png: lossless; jpg: quality 95; by default what an MJPEG camera sends as it comes, else png")
      ->check(CLI::IsMember({"png", "jpg"}));
  command->add_option("--calibration", arguments->calibration,
                      "Camera calibration, of the whole picture or of the region; goes into the recording");
  command->add_option("--mask", arguments->mask, "Static mask (255 inside); goes into the recording");
  command->add_flag("--halve", arguments->halve, "Halve the resolution by averaging 2x2 pixels");
  AddDeinterlaceOption(*command, arguments->deinterlace);
  command->get_option("--deinterlace")->needs(command->get_option("--halve"));
  command->callback([arguments, &action] { action = [arguments] { return Capture(*arguments); }; });
}

}  // namespace haustra
