#include "tools/calibrate/calibrate_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "capture/calibration_reader.h"
#include "capture/codec/image_codec.h"
#include "capture/v4l2/v4l2_options.h"
#include "tools/calibrate/calibration_text.h"
#include "tools/calibrate/clip_calibration.h"
#include "tools/calibrate/residual_picture.h"
#include "tools/command/common_options.h"
#include "tools/command/configuration_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/command/progress_line.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

constexpr const char* kCalibrateCommand = "calibrate";
// As WriteCalibration begins its files. What others have put there may be better than an estimate.
const FileContent kCalibrationContent{
    "an estimate of haustra calibrate",
    {"%YAML:1.0\n# Estimated by haustra calibrate\n", "# Estimated by haustra calibrate\n"}};
const FileContent kPictureContent{"a PNG picture", {"\x89PNG\r\n\x1a\n"}, false};

struct CalibrateArguments {
  ClipCalibrationRequest request;
  std::string out;
  std::string picture;
  bool overwrite = false;
};

int RunCalibrate(CalibrateArguments arguments) {
  ClipCalibrationRequest& request = arguments.request;
  if (IsV4l2Spec(request.sequence)) {
    return console::Fail(kCalibrateCommand,
                         InvalidArgument("a live camera is recorded first (haustra capture --out FOLDER)"), kExitUsage);
  }
  if (const Status differ = CheckOutputsDiffer({"--out", arguments.out}, {"--picture", arguments.picture});
      !differ.ok()) {
    return console::Fail(kCalibrateCommand, differ, kExitUsage);
  }
  const std::vector<std::string> inputs = {request.sequence, request.options.mask_path};
  Status writable = CheckOutputFile(arguments.out, kCalibrationContent, arguments.overwrite, inputs);
  if (writable.ok() && !arguments.picture.empty()) {
    writable = CheckOutputFile(arguments.picture, kPictureContent, arguments.overwrite, inputs);
  }
  if (!writable.ok()) return console::FailWriting(kCalibrateCommand, writable);
  ProgressLine line;
  request.on_frame = [&line](std::uint32_t frame, std::uint32_t num_frames) {
    line.Update([&] {
      return "looking at frame " + std::to_string(frame + 1) +
             (num_frames > 0 ? " of " + std::to_string(num_frames) : std::string());
    });
  };
  const Result<ClipCalibration> result = CalibrateFromClip(request);
  line.Leave();
  if (!result.ok()) return console::Fail(kCalibrateCommand, result.status());
  if (const Status& verdict = result->estimate.verdict; !verdict.ok()) {
    return console::Fail(kCalibrateCommand,
                         Status(verdict.code(), request.sequence + ": " + verdict.message() +
                                                    ".\n'haustra run' goes on with a guess and says so: " +
                                                    GuessText(result->calibration)));
  }
  CatchStopSignals();  // both files are written to their end
  if (const Status status = WriteCalibration(arguments.out, result->calibration, kEstimateRemark); !status.ok()) {
    return console::FailWriting(kCalibrateCommand, status);
  }
  if (!arguments.picture.empty()) {
    const Image picture = DrawResiduals(result->estimate.residuals, result->width_px, result->height_px);
    if (const Status status = WritePng(arguments.picture, picture.view()); !status.ok())
      return console::FailWriting(kCalibrateCommand, status);
  }
  console::Tell(
      "%s\n%s  took          %.0f s; %d frames looked at, %d of them left out for want of features\n"
      "  written to    %s\n",
      request.sequence.c_str(), CalibrationText(*result).c_str(), line.elapsed_s(), result->counters.num_frames,
      result->counters.num_poor, arguments.out.c_str());
  return kExitOk;
}

}  // namespace

void AddCalibrateCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<CalibrateArguments>();
  ClipCalibrationRequest& request = arguments->request;
  CLI::App* command = app.add_subcommand("calibrate", "Estimate the camera's calibration from the clip itself");
  command->add_option("sequence", request.sequence, "As for `haustra run`, but for live cameras")->required();
  command->add_option("--out", arguments->out, "Calibration file to write")->required();
  command->add_option("--picture", arguments->picture, "PNG file for a picture of the residuals");
  AddOverwriteFlag(*command, arguments->overwrite);
  AddFrameRangeOptions(*command, request.options);
  AddFrameRateOption(*command, request.options.frame_rate_hz);
  AddDeinterlaceOption(*command, request.options.deinterlace);
  command->add_option("--mask", request.options.mask_path,
                      "Static mask to use instead of the sequence's own (255 inside)");
  command->add_option("--seed", request.seed, "Seed of all random sampling")
      ->transform(WholeNumber<std::uint64_t>())
      ->capture_default_str();
  AddDeviceOptions(*command, request.device, request.threads);
  command->callback([arguments, &action] { action = [arguments] { return RunCalibrate(*arguments); }; });
}

}  // namespace haustra
