#include "tools/report/report_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "platform/file_sink.h"
#include "tools/evaluate/evaluate_run.h"
#include "tools/exit_codes.h"
#include "tools/report/join_pictures.h"
#include "tools/report/page.h"

namespace haustra {
namespace {

struct ReportArguments {
  std::string run;
  std::string groundtruth;
  std::string events;
  std::string html;
  report::PictureOptions pictures;
  evaluate::EvaluateOptions options;
};

int FailReport(const Status& status) {
  std::fprintf(stderr, "haustra report: %s\n", status.message().c_str());
  return ExitCodeFor(status.code());
}

// The models of the maps that the run has exported.
Result<std::map<int, report::MapModel>> ReadModels(const evaluate::RunOutput& run) {
  std::map<int, report::MapModel> models;
  for (const auto& [map_id, geometry] : run.geometry) {
    const std::filesystem::path folder = std::filesystem::path(run.folder) / "maps" / report::MapFolderName(map_id);
    HAUSTRA_ASSIGN(models[map_id], report::ReadMapModel(folder.string()));
  }
  return models;
}

int RunReport(const ReportArguments& arguments) {
  evaluate::Reference reference;
  if (!arguments.groundtruth.empty()) {
    Result<evaluate::Reference> read = evaluate::ReadReference(arguments.groundtruth, arguments.events);
    if (!read.ok()) return FailReport(read.status());
    reference = std::move(*read);
  }
  const Result<evaluate::RunOutput> run = evaluate::ReadRunOutput(arguments.run);
  if (!run.ok()) return FailReport(run.status());
  const Result<std::map<int, report::MapModel>> models = ReadModels(*run);
  if (!models.ok()) return FailReport(models.status());
  const evaluate::Evaluation evaluation = evaluate::EvaluateRun(*run, reference, arguments.options);
  std::string pictures;
  if (!arguments.pictures.sequence.empty()) {
    Result<std::string> html = report::JoinPicturesHtml(*run, evaluation, *models, arguments.pictures);
    if (!html.ok()) return FailReport(html.status());
    pictures = std::move(*html);
  }
  const std::string page = report::MakePage({*run, reference, evaluation, *models, pictures});
  const auto write = [&]() -> Status {
    HAUSTRA_ASSIGN(FileSink sink, FileSink::Create(arguments.html));
    HAUSTRA_TRY(sink.Write(page));
    return sink.Commit();
  };
  if (const Status status = write(); !status.ok()) {
    std::fprintf(stderr, "haustra report: %s\n", status.message().c_str());
    return kExitIo;
  }
  std::printf("%s (%.1f MB)\n", arguments.html.c_str(), static_cast<double>(page.size()) * 1e-6);
  return kExitOk;
}

}  // namespace

void AddReportCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<ReportArguments>();
  CLI::App* command = app.add_subcommand("report", "Show a run as one HTML page that needs no network");
  command->add_option("out", arguments->run, "Output folder of haustra run")->required();
  command->add_option("--html", arguments->html, "The page")->required();
  CLI::Option* groundtruth = command->add_option(
      "--groundtruth", arguments->groundtruth,
      "True poses: TUM (world_from_cam), EuRoC or C3VD file (default: none, maps are shown in their own frames)");
  command
      ->add_option("--events", arguments->events,
                   "When the scene cannot be seen: first_frame,last_frame,kind,visible "
                   "(default: events.csv beside the ground truth)")
      ->needs(groundtruth);
  CLI::Option* sequence =
      command->add_option("--sequence", arguments->pictures.sequence,
                          "The sequence of the run, for pictures of the frames where maps were joined");
  command->add_option("--every-nth", arguments->pictures.every_nth, "As in the run: it used only every n-th frame")
      ->check(CLI::Range(1u, 1000u))
      ->needs(sequence)
      ->capture_default_str();
  command->add_option("--calibration", arguments->pictures.calibration, "As in the run")->needs(sequence);
  command->add_option("--max-pictures", arguments->pictures.max_joins, "Merges and loops shown with pictures")
      ->check(CLI::Range(1u, 1000u))
      ->needs(sequence)
      ->capture_default_str();
  command
      ->add_option("--deadline-ms", arguments->options.deadline_ms,
                   "Deadline of a frame (default: the frame period at the pace of the run)")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--scene-depth", arguments->options.scene_depth,
                   "Typical distance of the scene in ground-truth units (default: from the maps' points)")
      ->check(CLI::PositiveNumber);
  command->add_flag("--positions-only", arguments->options.joins.positions_only,
                    "The true orientations are not to be trusted: do not use them");
  command->callback([arguments, &action] { action = [arguments] { return RunReport(*arguments); }; });
}

}  // namespace haustra
