#include "tools/evaluate/run_table.h"

#include <algorithm>
#include <filesystem>

#include "tools/evaluate/number_text.h"

namespace haustra::evaluate {
namespace {

struct Metric {
  const char* name;
  int decimals;
  std::optional<double> (*of)(const Evaluation&);
};

template <typename T>
std::optional<double> Number(const std::optional<T>& value) {
  return value ? std::optional<double>(static_cast<double>(*value)) : std::nullopt;
}

template <typename T>
double Number(T value) {
  return static_cast<double>(value);
}

std::optional<double> TimeOf(const Evaluation& e, double Percentiles::*field) {
  return e.frame_ms ? std::optional<double>((*e.frame_ms).*field) : std::nullopt;
}

std::optional<double> MeanOf(const Evaluation& e, double MapTable::*field) {
  return e.mean_map ? std::optional<double>((*e.mean_map).*field) : std::nullopt;
}

using E = const Evaluation&;
using Value = std::optional<double>;

const Metric kMetrics[] = {
    {"frames", 1, [](E e) -> Value { return Number(e.frames); }},
    {"localised", 1, [](E e) -> Value { return Number(e.localised); }},
    {"coverage", 2, [](E e) -> Value { return e.coverage; }},
    {"visible_coverage", 2, [](E e) -> Value { return e.visible_coverage; }},
    {"rms_ate", 4, [](E e) -> Value { return e.rms_ate; }},
    {"max_error", 4, [](E e) -> Value { return e.max_error; }},
    {"maps", 1, [](E e) -> Value { return Number(e.maps); }},
    {"merges", 1, [](E e) -> Value { return Number(e.merges.made); }},
    {"loops", 1, [](E e) -> Value { return Number(e.loops.made); }},
    {"relocalisations", 1, [](E e) -> Value { return Number(e.relocalisations.made); }},
    {"false_merges", 1, [](E e) -> Value { return Number(e.false_merges); }},
    {"merge_recall", 3, [](E e) -> Value { return e.merge_recall ? e.merge_recall->value() : Value(); }},
    {"largest_map_frames", 1, [](E e) -> Value { return Number(e.largest_map_frames); }},
    {"keyframes", 1, [](E e) -> Value { return Number(e.keyframes); }},
    {"map_points", 1, [](E e) -> Value { return Number(e.map_points); }},
    {"keyframes_per_s", 2, [](E e) -> Value { return MeanOf(e, &MapTable::keyframes_per_s); }},
    {"life_time_s", 2, [](E e) -> Value { return MeanOf(e, &MapTable::life_time_s); }},
    {"observations_per_frame", 1, [](E e) -> Value { return MeanOf(e, &MapTable::observations_per_frame); }},
    {"observations_per_point", 1, [](E e) -> Value { return MeanOf(e, &MapTable::observations_per_point); }},
    {"frame_ms.p50", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::p50); }},
    {"frame_ms.p99", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::p99); }},
    {"frame_ms.p999", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::p999); }},
    {"frame_ms.max", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::max); }},
    {"deadline_misses", 1, [](E e) -> Value { return Number(e.deadline_misses); }},
    {"dropped", 1, [](E e) -> Value { return Number(e.dropped); }},
    {"peak_rss_mb", 1, [](E e) -> Value { return e.peak_rss_mb; }},
    {"realtime_ratio", 3, [](E e) -> Value { return e.realtime_ratio; }},
};

// The last part of the path; a separator at its end does not count.
std::string ShortName(const std::string& folder) {
  const std::filesystem::path path(folder);
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

using Cells = std::vector<std::vector<std::string>>;

Cells MakeCells(std::span<const Evaluation> evaluations, TableFormat format) {
  Cells cells{{"metric", "mean", "std", "min", "max"}};
  for (const Evaluation& evaluation : evaluations) cells[0].push_back(ShortName(evaluation.name));
  // Blank in a CSV file: a dash would not be a number.
  const auto text = [&](const std::optional<double>& value, int decimals) {
    return value || format != TableFormat::kCsv ? Fixed(value, decimals) : std::string();
  };
  for (const TableRow& row : MakeRunTable(evaluations)) {
    const auto of = [&](double Spread::*field) { return row.spread ? Value((*row.spread).*field) : Value(); };
    std::vector<std::string> line{row.metric};
    for (const auto field : {&Spread::mean, &Spread::deviation, &Spread::min, &Spread::max}) {
      line.push_back(text(of(field), row.decimals));
    }
    for (const std::optional<double>& value : row.values) line.push_back(text(value, row.decimals));
    cells.push_back(std::move(line));
  }
  return cells;
}

std::vector<std::size_t> ColumnWidths(const Cells& cells) {
  std::vector<std::size_t> widths(cells[0].size(), 0);
  for (const auto& line : cells) {
    for (std::size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], line[i].size());
  }
  return widths;
}

// A field with a comma or a quote goes into quotes (RFC 4180).
std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

std::vector<TableRow> MakeRunTable(std::span<const Evaluation> evaluations) {
  std::vector<TableRow> rows;
  for (const Metric& metric : kMetrics) {
    TableRow row{metric.name, metric.decimals, {}, std::nullopt};
    std::vector<double> known;
    for (const Evaluation& evaluation : evaluations) {
      row.values.push_back(metric.of(evaluation));
      if (row.values.back()) known.push_back(*row.values.back());
    }
    if (!known.empty()) row.spread = FindSpread(known);
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string FormatRunTable(std::span<const Evaluation> evaluations, TableFormat format) {
  const Cells cells = MakeCells(evaluations, format);
  const std::vector<std::size_t> widths = ColumnWidths(cells);
  std::string text;
  for (std::size_t row = 0; row < cells.size(); ++row) {
    if (format == TableFormat::kMarkdown) text += "| ";
    for (std::size_t i = 0; i < cells[row].size(); ++i) {
      if (format == TableFormat::kCsv) {
        if (i > 0) text += ',';
        text += CsvField(cells[row][i]);
        continue;
      }
      if (i > 0) text += format == TableFormat::kMarkdown ? " | " : "  ";
      text += i == 0 ? PadRight(cells[row][i], widths[i]) : PadLeft(cells[row][i], widths[i]);
    }
    text += format == TableFormat::kMarkdown ? " |\n" : "\n";
    if (row == 0 && format == TableFormat::kMarkdown) {
      text += "|";
      for (std::size_t i = 0; i < widths.size(); ++i) text += std::string(widths[i] + 1, '-') + (i == 0 ? "-|" : ":|");
      text += "\n";
    }
  }
  return text;
}

}  // namespace haustra::evaluate
