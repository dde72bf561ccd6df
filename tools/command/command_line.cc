#include "tools/command/command_line.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <functional>
#include <string>

#include "platform/usage_error.h"
#include "platform/version.h"
#include "tools/atlas/atlas_command.h"
#include "tools/bench_command/bench_command.h"
#include "tools/calibrate/calibrate_command.h"
#include "tools/capture/capture_command.h"
#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/stop_signal.h"
#include "tools/evaluate/evaluate_command.h"
#include "tools/exit_codes.h"
#include "tools/export/export_command.h"
#include "tools/latency/latency_command.h"
#include "tools/plan/plan_command.h"
#include "tools/render/render_command.h"
#include "tools/report/report_command.h"
#include "tools/run/run_command.h"
#include "tools/service/control_command.h"
#include "tools/service/watch_command.h"
#include "tools/soak/soak_command.h"
#include "tools/surface/surface_command.h"
#include "tools/view/view_command.h"
#include "tools/vocabulary/vocabulary_command.h"

namespace haustra {
void AddCommands(CLI::App& app, std::function<int()>& action) {
  app.require_subcommand(1);
  app.failure_message(UsageErrorText);
  AddRenderCommand(app, action);
  AddRunCommand(app, action);
  AddEvaluateCommand(app, action);
  AddReportCommand(app, action);
  AddViewCommand(app, action);
  AddExportCommand(app, action);
  AddSurfaceCommand(app, action);
  AddAtlasCommand(app, action);
  AddVocabularyCommand(app, action);
  AddBenchCommand(app, action);
  AddCaptureCommand(app, action);
  AddCalibrateCommand(app, action);
  AddPlanCommand(app, action);
  AddLatencyCommand(app, action);
  AddSoakCommand(app, action);
  AddControlCommand(app, action);
  AddWatchCommand(app, action);
  AddQuietFlags(app);
  AddExitCodes(app);
}

namespace {

int Run(int argc, char** argv) {
  CLI::App app("Monocular visual SLAM for endoscopy", "haustra");
  app.set_version_flag("--version", std::string("haustra ") + Version());
  std::function<int()> action;
  AddCommands(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  HandleSignals(app.get_subcommands().front()->get_name().c_str());
  try {
    return action();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "haustra: %s\n", error.what());
    return kExitInternal;
  }
}

}  // namespace

int RunCommandLine(int argc, char** argv) {
  const int code = Run(argc, argv);
  const Status output = console::FinishOutput();
  if (output.ok() || code != kExitOk) return code;
  std::fprintf(stderr, "haustra: %s\n", output.message().c_str());
  return kExitIo;
}

}  // namespace haustra
