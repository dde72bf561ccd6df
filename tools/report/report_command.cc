#include "tools/report/report_command.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/exit_codes.h"
#include "tools/report/page.h"
#include "tools/report/run_report.h"

namespace haustra {
namespace {

constexpr const char* kReportCommand = "report";

struct ReportArguments {
  report::ReportRequest request;
  std::optional<std::string> html;  // nothing: beside the run
  bool overwrite = false;
};

int RunReport(const ReportArguments& arguments) {
  const report::ReportRequest& request = arguments.request;
  // Else a run that is not there would pass for a place that cannot be written to.
  if (std::error_code error; !arguments.html && !std::filesystem::is_directory(request.run, error)) {
    return console::Fail(kReportCommand, NotFound(request.run + ": no such folder"));
  }
  const std::string html = arguments.html.value_or((std::filesystem::path(request.run) / "report.html").string());
  const FileContent content{"a report of haustra", {report::RunPageStart()}};
  const Status checked = CheckOutputFile(html, content, arguments.overwrite,
                                         {request.groundtruth, request.events, request.pictures.sequence});
  if (!checked.ok()) return console::FailWriting(kReportCommand, checked);
  const Result<std::string> page = report::MakeRunReport(request);
  if (!page.ok()) return console::Fail(kReportCommand, page.status());
  if (const Status status = WriteFile(html, *page); !status.ok()) {
    return console::FailWriting(kReportCommand, status);
  }
  console::Tell("%s (%.1f MB)\n", html.c_str(), static_cast<double>(page->size()) * 1e-6);
  return kExitOk;
}

}  // namespace

void AddReportCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<ReportArguments>();
  CLI::App* command = app.add_subcommand("report", "Show a run as one HTML page that needs no network");
  report::ReportRequest& request = arguments->request;
  command->add_option("out", request.run, "Output folder of haustra run")->required();
  command->add_option("--html", arguments->html, "The page (default: OUT/report.html)");
  AddOverwriteFlag(*command, arguments->overwrite);
  CLI::Option* groundtruth = command->add_option(
      "--groundtruth", request.groundtruth,
      "True poses: TUM (world_from_cam), EuRoC or C3VD file (default: none, maps are shown in their own frames)");
  command
      ->add_option("--events", request.events,
                   "When the scene cannot be seen: first_frame,last_frame,kind,visible "
                   "(default: events.csv beside the ground truth)")
      ->needs(groundtruth);
  CLI::Option* sequence =
      command->add_option("--sequence", request.pictures.sequence,
                          "The sequence of the run, for pictures of the frames where maps were joined");
  command->add_option("--max-pictures", request.pictures.max_joins, "Merges and loops shown with pictures")
      ->transform(WholeNumberBetween(1u, 1000u))
      ->needs(sequence)
      ->capture_default_str();
  command->add_option("--surface", request.surface,
                      "Output folder of haustra surface, for the unrolled wall: what was seen and what was not "
                      "(default: OUT/surface, where it is there)");
  command
      ->add_option("--deadline-ms", request.options.deadline_ms,
                   "Deadline of a frame (default: the frame period at the pace of the run)")
      ->check(PositiveNumber());
  command
      ->add_option("--scene-depth", request.options.scene_depth,
                   "Typical distance of the scene in ground-truth units (default: from the maps' points)")
      ->check(PositiveNumber());
  command->add_flag("--positions-only", request.options.joins.positions_only,
                    "The true orientations are not to be trusted: do not use them");
  command->callback([arguments, &action] { action = [arguments] { return RunReport(*arguments); }; });
}

}  // namespace haustra
