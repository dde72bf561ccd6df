#include "tools/calibrate/calibrate_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>

#include "capture/calibration_reader.h"
#include "capture/codec/image_codec.h"
#include "capture/v4l2/v4l2_options.h"
#include "tools/calibrate/calibration_text.h"
#include "tools/calibrate/clip_calibration.h"
#include "tools/calibrate/residual_picture.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

struct CalibrateArguments {
  ClipCalibrationRequest request;
  std::string out;
  std::string picture;
};

int FailCalibrate(const Status& status) {
  std::fprintf(stderr, "haustra calibrate: %s\n", status.ToString().c_str());
  return ExitCodeFor(status.code());
}

int FailToWrite(const Status& status) {
  std::fprintf(stderr, "haustra calibrate: %s\n", status.ToString().c_str());
  return status.code() == StatusCode::kUnavailable ? kExitIo : ExitCodeFor(status.code());
}

int RunCalibrate(CalibrateArguments arguments) {
  ClipCalibrationRequest& request = arguments.request;
  if (IsV4l2Spec(request.sequence)) {
    std::fprintf(stderr, "haustra calibrate: a live camera is recorded first (haustra capture --out FOLDER)\n");
    return kExitUsage;
  }
  const auto start = std::chrono::steady_clock::now();
  const bool is_terminal = isatty(fileno(stderr)) != 0;
  if (is_terminal) {
    request.on_frame = [](std::uint32_t frame, std::uint32_t num_frames) {
      std::fprintf(stderr, "\rlooking at frame %u of %u ", frame + 1, num_frames);
    };
  }
  const Result<ClipCalibration> result = CalibrateFromClip(request);
  if (is_terminal) std::fprintf(stderr, "\n");
  if (!result.ok()) return FailCalibrate(result.status());
  if (const Status status = WriteCalibration(arguments.out, result->calibration); !status.ok()) {
    return FailToWrite(status);
  }
  if (!arguments.picture.empty()) {
    const Image picture = DrawResiduals(result->estimate.residuals, result->width_px, result->height_px);
    if (const Status status = WritePng(arguments.picture, picture.view()); !status.ok()) return FailToWrite(status);
  }
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf(
      "%s\n%s  took          %.0f s; %d frames looked at, %d of them left out for want of features\n"
      "  written to    %s\n",
      request.sequence.c_str(), CalibrationText(*result).c_str(), elapsed_s, result->counters.num_frames,
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
  command->add_option("--first-frame", request.options.first_frame, "First frame of the clip to use");
  command->add_option("--last-frame", request.options.last_frame, "Last frame of the clip to use");
  command->add_option("--every-nth", request.options.every_nth, "Use only every n-th frame")
      ->check(CLI::Range(1u, 1000u))
      ->capture_default_str();
  command->add_option("--mask", request.options.mask_path,
                      "Static mask to use instead of the sequence's own (255 inside)");
  command->add_option("--rate", request.rate_hz, "Frames a second, for a folder of images that does not say")
      ->check(CLI::Range(0.1, 1000.0));
  command->add_option("--seed", request.seed, "Seed of all random sampling")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--device", request.device, "Vision device")
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->capture_default_str();
  command->add_option("--threads", request.threads, "Threads of the CPU device, 0: one a core")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  command->callback([arguments, &action] { action = [arguments] { return RunCalibrate(*arguments); }; });
}

}  // namespace haustra
