// haustrad: the service (daemon.h). One foreground process; systemd's unit is config/service/haustrad.service.
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "platform/clock/system_clock.h"
#include "platform/daemon/daemon.h"
#include "platform/daemon/wipe_memory.h"
#include "platform/exit_codes.h"
#include "platform/realtime/one_heap.h"

namespace {

int Run(int argc, char** argv) {
  using namespace haustra;
  CLI::App app{"haustrad: monocular visual SLAM for endoscopy, as a service"};
  app.set_version_flag("--version", "haustrad 0.1.0");
  std::string config_path;
  std::string source;
  std::vector<std::string> assignments;
  bool check_config = false;
  bool print_config = false;
  app.add_option("--config", config_path, "Configuration file (YAML)");
  app.add_option("--set", assignments, "Overrides one key of the configuration: section.key=value")
      ->allow_extra_args(false);
  app.add_option("--source", source, "Camera, folder of frames, data set or video: the same as --set source.path=...");
  app.add_flag("--check-config", check_config, "Reads the configuration and ends: 0, or 78 and what is wrong with it");
  app.add_flag("--print-config", print_config, "Prints the configuration with the origin of each value, and ends");
  app.footer(
      "Exit codes: 0 stopped as told, 64 wrong arguments, 65 source or calibration is not what it should be, 66 no "
      "such "
      "source,\n69 device not available, 70 internal error, 71 the system refuses, 74 files cannot be written, 75 "
      "another\nhaustrad uses the state folder, 78 configuration.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  if (!source.empty()) assignments.push_back("source.path=" + source);
  const Result<ConfigStore<DaemonConfig>> loaded = LoadDaemonConfig(config_path, assignments);
  if (!loaded.ok()) {
    std::fprintf(stderr, "haustrad: %s\n", loaded.status().message().c_str());
    return kExitConfig;
  }
  if (print_config) std::fputs(loaded->Print().c_str(), stdout);
  if (print_config || check_config) return kExitOk;

  // What it writes is for nobody else, but for the files that are shared on purpose.
  ::umask(0077);
  OverwriteFreedMemory();
  UseOneHeap();
  Daemon::BlockSignals();
  const SystemClock clock;
  Daemon daemon(loaded->config(), {config_path, assignments}, clock);
  return daemon.Run();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "haustrad: %s\n", error.what());
    return haustra::kExitInternal;
  }
}
