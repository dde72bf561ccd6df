#include "tools/command/configuration_options.h"

#include <CLI/CLI.hpp>

namespace haustra {

void AddConfigurationOptions(CLI::App& command, ConfigurationOptions& options) {
  command.add_option("--config", options.config, "Configuration file (YAML); see config/");
  // One assignment each time: without this, it would take the words that follow as well.
  command.add_option("--set", options.assignments, "Overrides one key of the configuration: section.key=value")
      ->allow_extra_args(false);
  command.add_option("--device", options.device, "Vision device")
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->capture_default_str();
  command.add_option("--threads", options.threads, "Threads of the CPU device, 0: one a core")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
}

}  // namespace haustra
