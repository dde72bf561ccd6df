#include "tools/evaluate/run_table.h"

#include <algorithm>
#include <utility>

#include "tools/evaluate/number_text.h"
#include "tools/evaluate/paper_tables.h"

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

std::optional<double> FieldOf(const std::optional<MapTable>& table, double MapTable::*field) {
  return table ? std::optional<double>((*table).*field) : std::nullopt;
}

std::optional<double> ValueOf(const std::optional<Recall>& recall) { return recall ? recall->value() : std::nullopt; }

using E = const Evaluation&;
using Value = std::optional<double>;

const Metric kMetrics[] = {
    {"frames", 1, [](E e) -> Value { return Number(e.frames); }},
    {"unanswered_frames", 1, [](E e) -> Value { return Number(e.unanswered_frames); }},
    {"live_localised", 1, [](E e) -> Value { return Number(e.live_localised); }},
    {"localised", 1, [](E e) -> Value { return Number(e.localised); }},
    {"live_coverage", 2, [](E e) -> Value { return e.live_coverage; }},
    {"coverage", 2, [](E e) -> Value { return e.coverage; }},
    {"live_visible_coverage", 2, [](E e) -> Value { return e.live_visible_coverage; }},
    {"visible_coverage", 2, [](E e) -> Value { return e.visible_coverage; }},
    {"rms_ate", 4, [](E e) -> Value { return e.rms_ate; }},
    {"max_error", 4, [](E e) -> Value { return e.max_error; }},
    {"maps", 1, [](E e) -> Value { return Number(e.maps); }},
    {"maps_created", 1, [](E e) -> Value { return Number(e.maps_created); }},
    {"merges", 1, [](E e) -> Value { return Number(e.merges.made); }},
    {"loops", 1, [](E e) -> Value { return Number(e.loops.made); }},
    {"relocalisations", 1, [](E e) -> Value { return Number(e.relocalisations.made); }},
    {"recoveries", 1, [](E e) -> Value { return Number(e.recoveries.made); }},
    {"false_merges", 1, [](E e) -> Value { return Number(e.false_merges); }},
    {"losses", 1, [](E e) -> Value { return Number(e.losses); }},
    {"merge_precision", 3, [](E e) -> Value { return e.merges.precision(); }},
    {"loop_precision", 3, [](E e) -> Value { return e.loops.precision(); }},
    {"relocalisation_precision", 3, [](E e) -> Value { return e.relocalisations.precision(); }},
    {"recovery_precision", 3, [](E e) -> Value { return e.recoveries.precision(); }},
    {"merge_recall", 3, [](E e) -> Value { return ValueOf(e.merge_recall); }},
    {"relocalisation_recall", 3, [](E e) -> Value { return ValueOf(e.relocalisation_recall); }},
    {"largest_map_frames", 1, [](E e) -> Value { return Number(e.largest_map_frames); }},
    {"largest_map_rms_ate", 4, [](E e) -> Value { return e.largest_map_rms_ate; }},
    {"largest_map_rms_ate_percent_of_depth", 2, [](E e) -> Value { return e.largest_map_rms_ate_percent_of_depth; }},
    {"keyframes", 1, [](E e) -> Value { return Number(e.keyframes); }},
    {"map_points", 1, [](E e) -> Value { return Number(e.map_points); }},
    {"mean_map.keyframes", 1, [](E e) -> Value { return FieldOf(e.mean_map, &MapTable::keyframes); }},
    {"mean_map.map_points", 1, [](E e) -> Value { return FieldOf(e.mean_map, &MapTable::map_points); }},
    {"mean_map.keyframes_per_s", 2, [](E e) -> Value { return FieldOf(e.mean_map, &MapTable::keyframes_per_s); }},
    {"mean_map.life_time_s", 2, [](E e) -> Value { return FieldOf(e.mean_map, &MapTable::life_time_s); }},
    {"mean_map.observations_per_frame", 2,
     [](E e) -> Value { return FieldOf(e.mean_map, &MapTable::observations_per_frame); }},
    {"mean_map.observations_per_point", 2,
     [](E e) -> Value { return FieldOf(e.mean_map, &MapTable::observations_per_point); }},
    {"largest_map.keyframes", 1, [](E e) -> Value { return FieldOf(e.largest_map, &MapTable::keyframes); }},
    {"largest_map.map_points", 1, [](E e) -> Value { return FieldOf(e.largest_map, &MapTable::map_points); }},
    {"largest_map.keyframes_per_s", 2, [](E e) -> Value { return FieldOf(e.largest_map, &MapTable::keyframes_per_s); }},
    {"largest_map.life_time_s", 2, [](E e) -> Value { return FieldOf(e.largest_map, &MapTable::life_time_s); }},
    {"largest_map.observations_per_frame", 2,
     [](E e) -> Value { return FieldOf(e.largest_map, &MapTable::observations_per_frame); }},
    {"largest_map.observations_per_point", 2,
     [](E e) -> Value { return FieldOf(e.largest_map, &MapTable::observations_per_point); }},
    {"frame_ms.p50", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::p50); }},
    {"frame_ms.p99", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::p99); }},
    {"frame_ms.p999", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::p999); }},
    {"frame_ms.max", 2, [](E e) -> Value { return TimeOf(e, &Percentiles::max); }},
    {"deadline_misses", 1, [](E e) -> Value { return Number(e.deadline_misses); }},
    {"dropped", 1, [](E e) -> Value { return Number(e.dropped); }},
    {"peak_rss_mb", 1, [](E e) -> Value { return e.peak_rss_mb; }},
    {"realtime_ratio", 3, [](E e) -> Value { return e.realtime_ratio; }},
};

const StageEvaluation* StageNamed(const Evaluation& evaluation, const std::string& name) {
  const auto found = std::find_if(evaluation.stages.begin(), evaluation.stages.end(),
                                  [&](const StageEvaluation& stage) { return stage.stage == name; });
  return found == evaluation.stages.end() ? nullptr : &*found;
}

// One row; `of` gives the value of a run.
template <typename ValueOfRun>
TableRow MakeRow(std::string metric, int decimals, std::span<const Evaluation> evaluations, ValueOfRun&& of) {
  TableRow row{std::move(metric), decimals, {}, std::nullopt};
  std::vector<double> known;
  for (const Evaluation& evaluation : evaluations) {
    row.values.push_back(of(evaluation));
    if (row.values.back()) known.push_back(*row.values.back());
  }
  if (!known.empty()) row.spread = FindSpread(known);
  return row;
}

void AddStageRows(std::span<const Evaluation> evaluations, std::vector<TableRow>* rows) {
  std::vector<std::string> names;
  for (const Evaluation& evaluation : evaluations) {
    for (const StageEvaluation& stage : evaluation.stages) {
      if (std::find(names.begin(), names.end(), stage.stage) == names.end()) names.push_back(stage.stage);
    }
  }
  constexpr std::pair<const char*, double StageEvaluation::*> kFields[] = {{"p50", &StageEvaluation::p50},
                                                                           {"p99", &StageEvaluation::p99},
                                                                           {"max", &StageEvaluation::max},
                                                                           {"mean", &StageEvaluation::mean},
                                                                           {"deviation", &StageEvaluation::deviation}};
  for (const std::string& name : names) {
    const std::string prefix = "stages." + name + ".";
    rows->push_back(MakeRow(prefix + "count", 1, evaluations, [&](E e) -> Value {
      const StageEvaluation* stage = StageNamed(e, name);
      return stage != nullptr ? Value(static_cast<double>(stage->count)) : std::nullopt;
    }));
    for (const auto& [field_name, field] : kFields) {
      rows->push_back(MakeRow(prefix + field_name, 2, evaluations, [&, member = field](E e) -> Value {
        const StageEvaluation* stage = StageNamed(e, name);
        return stage != nullptr ? Value(stage->*member) : std::nullopt;
      }));
    }
  }
}

}  // namespace

std::vector<TableRow> MakeRunRows(std::span<const Evaluation> evaluations) {
  std::vector<TableRow> rows;
  for (const Metric& metric : kMetrics) rows.push_back(MakeRow(metric.name, metric.decimals, evaluations, metric.of));
  AddStageRows(evaluations, &rows);
  return rows;
}

TextTable MakeRunTable(std::span<const Evaluation> evaluations) {
  TextTable table;
  table.title = "All figures";
  table.header = {"metric", "mean", "std", "min", "max"};
  for (const Evaluation& evaluation : evaluations) table.header.push_back(ShortName(evaluation.name));
  for (const TableRow& row : MakeRunRows(evaluations)) {
    std::vector<std::string> line{row.metric};
    for (const auto field : {&Spread::mean, &Spread::deviation, &Spread::min, &Spread::max}) {
      line.push_back(Fixed(row.spread ? Value((*row.spread).*field) : Value(), row.decimals));
    }
    for (const Value& value : row.values) line.push_back(Fixed(value, row.decimals));
    table.rows.push_back(std::move(line));
  }
  return table;
}

}  // namespace haustra::evaluate
