#include "platform/daemon/daemon_options.h"

#include <CLI/CLI.hpp>

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
  app.footer(
      "Exit codes:\n"
      "  0  stopped as told\n"
      "  64 wrong arguments\n"
      "  65 source or calibration is not what it should be\n"
      "  66 no such source or calibration\n"
      "  69 device not available\n"
      "  70 internal error\n"
      "  71 the system refuses\n"
      "  74 files cannot be written\n"
      "  75 another haustrad uses the state folder\n"
      "  78 a configuration that is wrong or not there, or whose memory plan does not fit");
}

}  // namespace haustra
