#include "tools/plan/plan_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "capture/calibration_reader.h"
#include "capture/open_sequence.h"
#include "platform/config/engine_config_table.h"
#include "platform/memory_plan.h"
#include "tools/command/configuration_options.h"
#include "tools/exit_codes.h"
#include "tools/plan/plan_text.h"

namespace haustra {
namespace {

struct PlanArguments : ConfigurationOptions {
  std::string sequence;
  std::string calibration;
  int width_px = 1440;
  int height_px = 1080;
  bool json = false;
};

int FailPlan(const Status& status) {
  std::fprintf(stderr, "haustra plan: %s\n", status.ToString().c_str());
  return ExitCodeFor(status.code());
}

Result<CameraCalibration> CameraOf(const PlanArguments& arguments) {
  if (!arguments.calibration.empty()) return ReadCalibration(arguments.calibration);
  if (!arguments.sequence.empty()) {
    HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(arguments.sequence, {}));
    return source->calibration();
  }
  CameraCalibration camera;
  camera.width_px = arguments.width_px;
  camera.height_px = arguments.height_px;
  return camera;
}

int Plan(const PlanArguments& arguments) {
  const Result<ConfigStore<EngineConfig>> loaded = LoadEngineConfig(arguments.config, arguments.assignments);
  if (!loaded.ok()) {
    std::fprintf(stderr, "haustra plan: %s\n", loaded.status().message().c_str());
    return kExitConfig;
  }
  const EngineConfig& config = loaded->config();
  const Result<CameraCalibration> camera = CameraOf(arguments);
  if (!camera.ok()) return FailPlan(camera.status());
  const Result<MemoryPlan> plan = PlanMemory(config, *camera, arguments.device, arguments.threads);
  if (!plan.ok()) return FailPlan(plan.status());
  if (arguments.json) {
    std::fputs(PlanJson(*plan).c_str(), stdout);
  } else {
    const std::string heading = "profile " + config.memory.profile + ", images " + std::to_string(camera->width_px) +
                                "x" + std::to_string(camera->height_px) + ", " + std::to_string(config.features.max) +
                                " features, device " + arguments.device;
    std::fputs(PlanText(heading, *plan).c_str(), stdout);
  }
  if (arguments.device == "cuda") {
    std::fprintf(stderr,
                 "haustra plan: note: what the CUDA driver takes for itself, some hundred MB, is not in the plan\n");
  }
  // After the table: what does not fit is to be seen in it.
  if (const Status status = CheckMemory(*plan, config, AvailableHostBytes()); !status.ok()) return FailPlan(status);
  return kExitOk;
}

}  // namespace

void AddPlanCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<PlanArguments>();
  CLI::App* command = app.add_subcommand("plan", "Print what a configuration takes in memory, pool by pool");
  AddConfigurationOptions(*command, *arguments);
  auto* sequence = command->add_option("--sequence", arguments->sequence, "Sequence whose images are planned for");
  auto* calibration = command->add_option("--calibration", arguments->calibration,
                                          "Camera calibration whose image size is planned for");
  calibration->excludes(sequence);
  command->add_option("--width", arguments->width_px, "Of the images, when neither of these is given")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  command->add_option("--height", arguments->height_px, "Of the images, when neither of these is given")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "Print JSON");
  command->callback([arguments, &action] { action = [arguments] { return Plan(*arguments); }; });
}

}  // namespace haustra
