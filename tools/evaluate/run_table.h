// Several runs side by side: each metric of each run, mean and spread. Runs are those of several seeds, usually.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/text_table.h"

namespace haustra::evaluate {

struct TableRow {
  std::string metric;                         // as in the JSON; nested ones with a dot: mean_map.keyframes
  int decimals = 0;                           // that are worth showing
  std::vector<std::optional<double>> values;  // one a run; nothing where the run does not have it
  std::optional<Spread> spread;               // over the runs that have it
};

// Every figure of an evaluation that is one number, those of the paper's tables among them; the stages by their names:
// stages.mapping/bundle.p99.
std::vector<TableRow> MakeRunRows(std::span<const Evaluation> evaluations);

// Columns: metric, mean, std (of the sample), min, max, then the runs by the names of their folders.
TextTable MakeRunTable(std::span<const Evaluation> evaluations);

}  // namespace haustra::evaluate
