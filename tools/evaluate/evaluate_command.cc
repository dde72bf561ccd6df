#include "tools/evaluate/evaluate_command.h"

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/evaluate/evaluate_run.h"
#include "tools/evaluate/paper_tables.h"
#include "tools/evaluate/report_json.h"
#include "tools/evaluate/report_text.h"
#include "tools/evaluate/run_table.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

constexpr const char* kEvaluateCommand = "evaluate";
const FileContent kJsonContent{"a file of haustra evaluate", {"{\n  \"run\": ", "{\n  \"runs\": "}};
const FileContent kTableContent{"a table of haustra evaluate", {"metric,mean,std,min,max,", "## Mapping results\n"}};

struct EvaluateArguments {
  std::vector<std::string> runs;
  std::string groundtruth;
  std::string events;
  std::string json;
  std::string table;
  bool overwrite = false;
  evaluate::EvaluateOptions options;
};

std::string AllTables(const std::vector<evaluate::Evaluation>& evaluations) {
  std::string text;
  for (const evaluate::TextTable& table :
       {evaluate::MakePaperTable(evaluations), evaluate::MakePrecisionTable(evaluations),
        evaluate::MakeStageTable(evaluations), evaluate::MakeJoinTable(evaluations),
        evaluate::MakeRunTable(evaluations)}) {
    if (table.rows.empty()) continue;
    text += (text.empty() ? "" : "\n") + FormatTable(table, evaluate::TableFormat::kMarkdown);
  }
  return text;
}

int RunEvaluate(const EvaluateArguments& arguments) {
  const bool is_csv = arguments.table.ends_with(".csv"), is_markdown = arguments.table.ends_with(".md");
  if (!arguments.table.empty() && !is_csv && !is_markdown) {
    return console::Fail(kEvaluateCommand,
                         InvalidArgument("--table " + arguments.table + ": the name must end in .csv or .md"),
                         kExitUsage);
  }
  if (const Status differ = CheckOutputsDiffer({"--json", arguments.json}, {"--table", arguments.table});
      !differ.ok()) {
    return console::Fail(kEvaluateCommand, differ, kExitUsage);
  }
  for (const auto& [path, content] : {std::pair(arguments.json, kJsonContent), {arguments.table, kTableContent}}) {
    if (path.empty()) continue;
    const Status status =
        CheckOutputFile(path, content, arguments.overwrite, {arguments.groundtruth, arguments.events});
    if (!status.ok()) return console::FailWriting(kEvaluateCommand, status);
  }
  const Result<evaluate::Reference> reference = evaluate::ReadReference(arguments.groundtruth, arguments.events);
  if (!reference.ok()) return console::Fail(kEvaluateCommand, reference.status());
  std::vector<evaluate::Evaluation> evaluations;
  for (const std::string& folder : arguments.runs) {
    const Result<evaluate::RunOutput> run = evaluate::ReadRunOutput(folder);
    if (!run.ok()) return console::Fail(kEvaluateCommand, run.status());
    evaluations.push_back(evaluate::EvaluateRun(*run, *reference, arguments.options));
  }

  const bool is_single = evaluations.size() == 1;
  for (std::size_t i = 0; i < evaluations.size(); ++i) {
    console::Print("%s%s", i > 0 ? "\n" : "", evaluate::ToText(evaluations[i]).c_str());
  }
  using evaluate::TableFormat;
  console::Print("\n%s", FormatTable(evaluate::MakePaperTable(evaluations), TableFormat::kText).c_str());
  if (!is_single) console::Print("\n%s", FormatTable(evaluate::MakeRunTable(evaluations), TableFormat::kText).c_str());
  if (!arguments.json.empty()) {
    const std::string text = is_single ? evaluate::ToJson(evaluations[0]) : evaluate::ToJson(evaluations);
    if (const Status status = WriteFile(arguments.json, text); !status.ok())
      return console::FailWriting(kEvaluateCommand, status);
  }
  if (!arguments.table.empty()) {
    const std::string text =
        is_csv ? FormatTable(evaluate::MakeRunTable(evaluations), TableFormat::kCsv) : AllTables(evaluations);
    if (const Status status = WriteFile(arguments.table, text); !status.ok())
      return console::FailWriting(kEvaluateCommand, status);
  }
  return kExitOk;
}

}  // namespace

void AddEvaluateCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<EvaluateArguments>();
  CLI::App* command = app.add_subcommand("evaluate", "Compare runs with the ground truth");
  command->add_option("out", arguments->runs, "Output folders of haustra run; several: mean and spread are added")
      ->required();
  command->add_option("--groundtruth", arguments->groundtruth,
                      "True poses: TUM (world_from_cam), EuRoC or C3VD file; matched by nearest time stamp "
                      "(default: none, errors, precision and recall are not known)");
  command->add_option("--events", arguments->events,
                      "When the scene cannot be seen: first_frame,last_frame,kind,visible "
                      "(default: events.csv beside the ground truth)");
  command->add_option("--json", arguments->json, "Write the figures to this file");
  command->add_option("--table", arguments->table,
                      "Write the figures with mean and spread to this file: .csv: all as one "
                      "table; .md: the paper's tables, every join, all figures");
  AddOverwriteFlag(*command, arguments->overwrite);
  command
      ->add_option("--scene-depth", arguments->options.scene_depth,
                   "Typical distance of the scene in ground-truth units (default: from the maps' points)")
      ->check(PositiveNumber());
  command
      ->add_option("--deadline-ms", arguments->options.deadline_ms,
                   "Deadline of a frame (default: the frame period at the pace of the run)")
      ->check(PositiveNumber());
  command
      ->add_option("--segment", arguments->options.segment,
                   "Errors of each stretch of this length along the true path, ground-truth units, too (default: none)")
      ->check(PositiveNumber());
  command->add_flag("--positions-only", arguments->options.joins.positions_only,
                    "The true orientations are not to be trusted: do not use them");
  command->callback([arguments, &action] { action = [arguments] { return RunEvaluate(*arguments); }; });
}

}  // namespace haustra
