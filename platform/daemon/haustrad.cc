// haustrad: the service (daemon.h). One foreground process; systemd's unit is config/service/haustrad.service.
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/daemon/daemon.h"
#include "platform/daemon/daemon_options.h"
#include "platform/daemon/no_dumps.h"
#include "platform/daemon/wipe_memory.h"
#include "platform/exit_codes.h"
#include "platform/realtime/one_heap.h"

namespace {

int Run(int argc, char** argv) {
  using namespace haustra;
  CLI::App app("", "haustrad");
  DaemonArguments arguments;
  AddDaemonOptions(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  std::vector<std::string>& assignments = arguments.assignments;
  if (!arguments.source.empty()) assignments.push_back("source.path=" + arguments.source);
  const Result<ConfigStore<DaemonConfig>> loaded = LoadDaemonConfig(arguments.config, assignments);
  if (!loaded.ok()) {
    std::fprintf(stderr, "haustrad: %s\n", loaded.status().message().c_str());
    return kExitConfig;
  }
  if (arguments.print_config) std::fputs(loaded->Print().c_str(), stdout);
  if (arguments.print_config || arguments.check_config) return kExitOk;

  // What it writes is for nobody else, but for the files that are shared on purpose.
  ::umask(0077);
  if (!ForbidDumps()) {
    std::fprintf(stderr, "haustrad: the system refuses to forbid core dumps\n");
    return kExitSystem;
  }
  OverwriteFreedMemory();
  UseOneHeap();
  Daemon::BlockSignals();
  const SystemClock clock;
  Daemon daemon(loaded->config(), {arguments.config, assignments}, clock, SystemParts());
  const int code = daemon.Run();
  if (daemon.is_given_up()) std::_Exit(code);
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    haustra::PrepareVisionDevices();
    return Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "haustrad: %s\n", error.what());
    return haustra::kExitInternal;
  }
}
