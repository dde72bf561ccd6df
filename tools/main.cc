// haustra: the command line. Each subcommand lives in a folder of its own.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <functional>

#include "tools/atlas/atlas_command.h"
#include "tools/bench/bench_command.h"
#include "tools/capture/capture_command.h"
#include "tools/evaluate/evaluate_command.h"
#include "tools/exit_codes.h"
#include "tools/latency/latency_command.h"
#include "tools/plan/plan_command.h"
#include "tools/render/render_command.h"
#include "tools/report/report_command.h"
#include "tools/run/run_command.h"
#include "tools/service/control_command.h"
#include "tools/service/watch_command.h"
#include "tools/soak/soak_command.h"
#include "tools/vocabulary/vocabulary_command.h"

int main(int argc, char** argv) {
  CLI::App app{"haustra: monocular visual SLAM for endoscopy"};
  app.set_version_flag("--version", "haustra 0.1.0");
  app.require_subcommand(1);
  std::function<int()> action;
  haustra::AddRenderCommand(app, action);
  haustra::AddRunCommand(app, action);
  haustra::AddEvaluateCommand(app, action);
  haustra::AddReportCommand(app, action);
  haustra::AddAtlasCommand(app, action);
  haustra::AddVocabularyCommand(app, action);
  haustra::AddBenchCommand(app, action);
  haustra::AddCaptureCommand(app, action);
  haustra::AddPlanCommand(app, action);
  haustra::AddLatencyCommand(app, action);
  haustra::AddSoakCommand(app, action);
  haustra::AddControlCommand(app, action);
  haustra::AddWatchCommand(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? haustra::kExitOk : haustra::kExitUsage;
  }
  try {
    return action();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "haustra: %s\n", error.what());
    return haustra::kExitInternal;
  }
}
