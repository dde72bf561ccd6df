#include "platform/daemon/daemon_options.h"

#include <CLI/CLI.hpp>

#include "platform/exit_codes.h"
#include "platform/version.h"

namespace haustra {

void AddDaemonOptions(CLI::App& app, DaemonArguments& arguments) {
  app.description("Monocular visual SLAM for endoscopy, as a service");
  app.set_version_flag("--version", std::string("haustrad ") + Version());
  app.add_option("--config", arguments.config, "Configuration file (YAML)");
  app.add_option("--set", arguments.assignments, "Overrides one key of the configuration: section.key=value")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  app.add_option("--source", arguments.source,
                 "Camera, folder of frames, data set or video: the same as --set source.path=...");
  app.add_flag("--check-config", arguments.check_config,
               "Reads the configuration and ends: 0, or 78 and what is wrong with it");
  app.add_flag("--print-config", arguments.print_config,
               "Prints the configuration with the origin of each value, and ends");
  app.footer(ExitCodesText(&ExitCodeMeaning::of_haustrad));
}

}  // namespace haustra
