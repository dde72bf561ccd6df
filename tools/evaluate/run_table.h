// Several runs side by side: each metric of each run, mean and spread. Runs are those of several seeds, usually.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/evaluate/evaluation.h"

namespace haustra::evaluate {

struct TableRow {
  std::string metric;                         // as in the JSON; nested ones with a dot: frame_ms.p99
  int decimals = 0;                           // that are worth showing
  std::vector<std::optional<double>> values;  // one a run; nothing where the run does not have it
  std::optional<Spread> spread;               // over the runs that have it
};

std::vector<TableRow> MakeRunTable(std::span<const Evaluation> evaluations);

enum class TableFormat { kText, kCsv, kMarkdown };

// Columns: metric, mean, std (of the sample), min, max, then the runs by the names of their folders.
std::string FormatRunTable(std::span<const Evaluation> evaluations, TableFormat format);

}  // namespace haustra::evaluate
