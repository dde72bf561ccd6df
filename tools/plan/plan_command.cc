#include "tools/plan/plan_command.h"
#include "tools/command/number_checks.h"

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "capture/calibration_reader.h"
#include "capture/open_sequence.h"
#include "platform/config/engine_config_table.h"
#include "platform/memory_plan.h"
#include "tools/command/common_options.h"
#include "tools/command/configuration_options.h"
#include "tools/command/console.h"
#include "tools/command/missing_calibration.h"
#include "tools/exit_codes.h"
#include "tools/plan/plan_text.h"

namespace haustra {
namespace {

constexpr const char* kPlanCommand = "plan";

struct PlanArguments : ConfigurationOptions {
  std::string sequence;
  std::string calibration;
  int width_px = 1440;
  int height_px = 1080;
  SequenceOptions part;  // of the sequence: how it is read
  bool json = false;
};

Result<CameraCalibration> CameraOf(const PlanArguments& arguments) {
  if (!arguments.calibration.empty()) return ReadCalibration(arguments.calibration);
  if (!arguments.sequence.empty()) {
    const Result<std::unique_ptr<FrameSource>> source = OpenSequence(arguments.sequence, arguments.part);
    if (!source.ok()) return WithCalibrationAdvice(source.status(), arguments.sequence, arguments.part);
    return (*source)->calibration();
  }
  CameraCalibration camera;
  camera.width_px = arguments.width_px;
  camera.height_px = arguments.height_px;
  // Any camera of this size: what is planned depends on nothing else.
  camera.fx = camera.fy = camera.width_px;
  camera.cx = 0.5 * (camera.width_px - 1);
  camera.cy = 0.5 * (camera.height_px - 1);
  return camera;
}

int Plan(const PlanArguments& arguments) {
  const Result<ConfigStore<EngineConfig>> loaded = LoadEngineConfig(arguments.config, arguments.assignments);
  if (!loaded.ok()) return console::Fail(kPlanCommand, loaded.status(), kExitConfig);
  const EngineConfig& config = loaded->config();
  const Result<CameraCalibration> camera = CameraOf(arguments);
  if (!camera.ok()) return console::Fail(kPlanCommand, camera.status());
  const Result<MemoryPlan> plan = PlanMemory(config, *camera, arguments.device, arguments.threads);
  if (!plan.ok()) return console::Fail(kPlanCommand, plan.status());
  if (arguments.json) {
    console::Print("%s", PlanJson(*plan).c_str());
  } else {
    const std::string heading = "profile " + config.memory.profile + ", images " + std::to_string(camera->width_px) +
                                "x" + std::to_string(camera->height_px) + ", " + std::to_string(config.features.max) +
                                " features, device " + arguments.device;
    console::Print("%s", PlanText(heading, *plan).c_str());
  }
  if (arguments.device == "cuda") {
    console::Note(kPlanCommand, "what the CUDA driver takes for itself, some hundred MB, is not in the plan");
  }
  // After the table: what does not fit is to be seen in it.
  if (const Status status = CheckMemory(*plan, config, AvailableHostMemory()); !status.ok())
    return console::Fail(kPlanCommand, status);
  return kExitOk;
}

}  // namespace

void AddPlanCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<PlanArguments>();
  CLI::App* command = app.add_subcommand("plan", "Print what a configuration takes in memory, pool by pool");
  AddConfigurationOptions(*command, *arguments);
  auto* sequence = command->add_option("--sequence", arguments->sequence, "Sequence whose images are planned for");
  AddFrameRateOption(*command, arguments->part.frame_rate_hz);
  auto* calibration = command->add_option("--calibration", arguments->calibration,
                                          "Camera calibration whose image size is planned for");
  calibration->excludes(sequence);
  command->add_option("--width", arguments->width_px, "Of the images, when neither of these is given")
      ->transform(WholeNumberBetween(16, 8192))
      ->capture_default_str();
  command->add_option("--height", arguments->height_px, "Of the images, when neither of these is given")
      ->transform(WholeNumberBetween(16, 8192))
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "Print JSON");
  command->callback([arguments, &action] { action = [arguments] { return Plan(*arguments); }; });
}

}  // namespace haustra
