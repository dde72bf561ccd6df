#include "tools/command/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "hal/core/edit_distance.h"
#include "platform/version.h"
#include "tools/atlas/atlas_command.h"
#include "tools/bench/bench_command.h"
#include "tools/calibrate/calibrate_command.h"
#include "tools/capture/capture_command.h"
#include "tools/command/common_options.h"
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
#include "tools/vocabulary/vocabulary_command.h"

namespace haustra {
namespace {

// Without a command that it knows CLI11 says only that one is required. This names what stands in its place.
std::string DescribeFailure(const CLI::App* app, const CLI::Error& error) {
  const std::vector<std::string> unknown = app->remaining();
  if (app->get_parent() != nullptr || !app->get_subcommands().empty() || unknown.empty())
    return CLI::FailureMessage::simple(app, error);
  const std::string& word = unknown.front();
  std::string text = word + (word.starts_with('-') ? ": no such option" : ": no such command");
  const std::vector<const CLI::App*> commands = app->get_subcommands([](const CLI::App*) { return true; });
  const auto distance = [&](const CLI::App* command) {
    return EditDistance(command->get_name(), word, LetterCase::kIgnored);
  };
  const auto nearest = std::min_element(commands.begin(), commands.end(),
                                        [&](const auto* a, const auto* b) { return distance(a) < distance(b); });
  if (nearest != commands.end() && distance(*nearest) <= 2) text += "; did you mean " + (*nearest)->get_name() + "?";
  return text + "\nRun with --help for more information.\n";
}

}  // namespace

void AddCommands(CLI::App& app, std::function<int()>& action) {
  app.require_subcommand(1);
  app.failure_message(DescribeFailure);
  AddRenderCommand(app, action);
  AddRunCommand(app, action);
  AddEvaluateCommand(app, action);
  AddReportCommand(app, action);
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

int RunCommandLine(int argc, char** argv) {
  CLI::App app("Monocular visual SLAM for endoscopy", "haustra");
  app.set_version_flag("--version", std::string("haustra ") + Version());
  std::function<int()> action;
  AddCommands(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  try {
    return action();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "haustra: %s\n", error.what());
    return kExitInternal;
  }
}

}  // namespace haustra
