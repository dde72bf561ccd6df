// haustrad: the service (daemon.h), and its worker (worker.h). One foreground process with one child; systemd's unit is
// config/service/haustrad.service.
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/daemon/daemon.h"
#include "platform/daemon/daemon_options.h"
#include "platform/daemon/log.h"
#include "platform/daemon/no_dumps.h"
#include "platform/daemon/rights.h"
#include "platform/daemon/worker.h"
#include "platform/daemon/worker_starter.h"
#include "platform/exit_codes.h"
#include "platform/realtime/one_heap.h"
#include "platform/usage_error.h"

namespace {

int Run(int argc, char** argv) {
  using namespace haustra;
  CLI::App app("", "haustrad");
  DaemonArguments arguments;
  AddDaemonOptions(app, arguments);
  app.failure_message(UsageErrorText);
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
  Daemon::BlockSignals();
  // The workers' rights are those of the process until here; its own are fewer from here on.
  const Result<std::unique_ptr<ForkedStarter>> starter =
      ForkedStarter::Fork({"/proc/self/exe", kWorkerOption, std::to_string(kWorkerChannel)});
  if (!starter.ok()) {
    std::fprintf(stderr, "haustrad: %s\n", starter.status().message().c_str());
    return kExitSystem;
  }
  DaemonConfig config = loaded->config();
  FillFolders(&config.files);
  const RightsTaken taken = TakeRightsAway({config.files.state_folder, config.files.runtime_folder});
  SetLogLevel(LogLevelFrom(config.log.level));
  Log(LogLevel::kInfo, "own_rights", {{"system_calls", taken.system_calls}, {"files", taken.files}});
  const SystemClock clock;
  Daemon daemon(config, {arguments.config, assignments}, clock,
                [&starter](int channel) { return (*starter)->Start(channel); });
  return daemon.Run();
}

// The supervisor's own way to start it; not among the options that people have.
int RunAsWorker(const std::string& channel) {
  using namespace haustra;
  if (channel != std::to_string(kWorkerChannel)) return kExitUsage;
  ::umask(0077);
  if (!BecomeWorker()) return kExitSystem;
  UseOneHeap();
  PrepareVisionDevices();
  return RunWorker(kWorkerChannel, SystemWorkerParts());
}

}  // namespace

int main(int argc, char** argv) {
  try {
    // Its threads may still run: nothing is destroyed under them.
    if (argc == 3 && argv[1] == std::string(haustra::kWorkerOption)) std::_Exit(RunAsWorker(argv[2]));
    return Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "haustrad: %s\n", error.what());
    return haustra::kExitInternal;
  }
}
