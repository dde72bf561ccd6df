#include "tools/command/configuration_options.h"

#include <CLI/CLI.hpp>

#include "platform/assemble.h"
#include "tools/command/number_checks.h"

namespace haustra {

void AddConfigurationOptions(CLI::App& command, ConfigurationOptions& options) {
  command.add_option("--config", options.config, "Configuration file (YAML); see config/");
  // One assignment each time: without this, it would take the words that follow as well.
  command.add_option("--set", options.assignments, "Overrides one key of the configuration: section.key=value")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  AddDeviceOptions(command, options.device, options.threads);
}

void AddDeviceOption(CLI::App& command, std::string& device) {
  command.add_option("--device", device, "Vision device; auto: cuda where this build and machine have it, else cpu")
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}))
      ->capture_default_str();
  command.parse_complete_callback([&device] { device = ResolveVisionDevice(device); });
}

void AddDeviceOptions(CLI::App& command, std::string& device, int& threads) {
  AddDeviceOption(command, device);
  command.add_option("--threads", threads, "Threads of the CPU device, 0: one a core, in real time one less")
      ->transform(WholeNumberBetween(0, MaxVisionThreads()))
      ->capture_default_str();
}

std::string DeviceText(const VisionDevice& device, int num_threads) {
  const std::string name(device.name());
  if (device.is_accelerator()) return name;
  return name + ", " + std::to_string(num_threads) + (num_threads == 1 ? " thread" : " threads");
}

}  // namespace haustra
