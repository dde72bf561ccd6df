#include "tools/evaluate/paper_tables.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "tools/evaluate/number_text.h"

namespace haustra::evaluate {
namespace {

using Value = std::optional<double>;

struct PaperColumn {
  const char* name;
  int decimals;
  Value (*of)(const Evaluation&);
};

Value Of(const std::optional<MapTable>& table, double MapTable::*field) {
  return table ? Value((*table).*field) : std::nullopt;
}

using E = const Evaluation&;

constexpr std::size_t kNumMeanColumns = 6, kNumLargestColumns = 4;
const PaperColumn kPaperColumns[] = {
    {"#KF", 1, [](E e) { return Of(e.mean_map, &MapTable::keyframes); }},
    {"#MP", 1, [](E e) { return Of(e.mean_map, &MapTable::map_points); }},
    {"KF/s", 2, [](E e) { return Of(e.mean_map, &MapTable::keyframes_per_s); }},
    {"life time s", 2, [](E e) { return Of(e.mean_map, &MapTable::life_time_s); }},
    {"#Obs/F", 2, [](E e) { return Of(e.mean_map, &MapTable::observations_per_frame); }},
    {"#Obs(F)/MP", 2, [](E e) { return Of(e.mean_map, &MapTable::observations_per_point); }},
    {"#KF", 1, [](E e) { return Of(e.largest_map, &MapTable::keyframes); }},
    {"#MP", 1, [](E e) { return Of(e.largest_map, &MapTable::map_points); }},
    {"KF/s", 2, [](E e) { return Of(e.largest_map, &MapTable::keyframes_per_s); }},
    {"life time s", 2, [](E e) { return Of(e.largest_map, &MapTable::life_time_s); }},
    {"#Maps", 1, [](E e) { return Value(e.maps); }},
    {"#Merges", 1, [](E e) { return Value(e.merges.made); }},
    {"#Relocations", 1, [](E e) { return Value(e.relocalisations.made); }},
    {"RMS ATE", 4, [](E e) { return e.rms_ate; }},
    {"live coverage %", 2, [](E e) { return Value(e.live_coverage); }},
    {"coverage %", 2, [](E e) { return Value(e.coverage); }},
    {"#KF", 1, [](E e) { return Value(e.keyframes); }},
    {"#MP", 1, [](E e) { return Value(e.map_points); }},
    {"real-time ratio", 3, [](E e) { return e.realtime_ratio; }},
};

// Counts of one run are whole numbers.
int DecimalsOfOne(const PaperColumn& column, bool is_count) { return is_count ? 0 : column.decimals; }

std::vector<double> Known(std::span<const Evaluation> evaluations, Value (*of)(const Evaluation&)) {
  std::vector<double> known;
  for (const Evaluation& evaluation : evaluations) {
    if (const Value value = of(evaluation)) known.push_back(*value);
  }
  return known;
}

std::string PercentText(const Value& share) { return share ? Fixed(100.0 * *share, 1) : kNothing; }

// The same stage of every run that has it.
std::vector<const StageEvaluation*> StagesNamed(std::span<const Evaluation> evaluations, const std::string& stage) {
  std::vector<const StageEvaluation*> found;
  for (const Evaluation& evaluation : evaluations) {
    for (const StageEvaluation& candidate : evaluation.stages) {
      if (candidate.stage == stage) found.push_back(&candidate);
    }
  }
  return found;
}

double MeanOf(const std::vector<const StageEvaluation*>& stages, double StageEvaluation::*field) {
  double sum = 0.0;
  for (const StageEvaluation* stage : stages) sum += stage->*field;
  return sum / static_cast<double>(stages.size());
}

std::string MapIds(const JoinEvaluation& join) {
  const std::string map = std::to_string(join.map_id);
  return join.other_map_id < 0 ? map : map + " and " + std::to_string(join.other_map_id);
}

}  // namespace

std::string ShortName(const std::string& folder) {
  const std::filesystem::path path(folder);
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

TextTable MakePaperTable(std::span<const Evaluation> evaluations) {
  TextTable table;
  table.title = "Mapping results";
  constexpr std::size_t kNumColumns = std::size(kPaperColumns);
  table.groups = {{"", 1},
                  {"mean of the maps", kNumMeanColumns},
                  {"largest map", kNumLargestColumns},
                  {"global", kNumColumns - kNumMeanColumns - kNumLargestColumns}};
  table.header = {"run"};
  const std::string unit = evaluations.empty() ? std::string() : evaluations[0].unit;
  for (const PaperColumn& column : kPaperColumns) {
    std::string name = column.name;
    if (name == "RMS ATE") name.append(" ").append(unit);
    table.header.push_back(std::move(name));
  }
  for (const Evaluation& evaluation : evaluations) {
    std::vector<std::string> row{ShortName(evaluation.name)};
    for (std::size_t i = 0; i < kNumColumns; ++i) {
      const PaperColumn& column = kPaperColumns[i];
      const bool is_count = i >= kNumMeanColumns && column.decimals == 1;
      row.push_back(Fixed(column.of(evaluation), DecimalsOfOne(column, is_count)));
    }
    table.rows.push_back(std::move(row));
  }
  if (evaluations.size() < 2) return table;
  std::vector<std::string> mean{"mean"}, deviation{"std"};
  for (const PaperColumn& column : kPaperColumns) {
    const std::vector<double> known = Known(evaluations, column.of);
    mean.push_back(known.empty() ? kNothing : Fixed(FindSpread(known).mean, column.decimals));
    deviation.push_back(known.empty() ? kNothing : Fixed(FindSpread(known).deviation, column.decimals));
  }
  table.rows.push_back(std::move(mean));
  table.rows.push_back(std::move(deviation));
  return table;
}

TextTable MakeMapTable(const Evaluation& evaluation) {
  TextTable table;
  table.title = "Maps";
  table.header = {"map",
                  "#KF",
                  "#MP",
                  "KF/s",
                  "life time s",
                  "#Obs/F",
                  "#Obs(F)/MP",
                  "frames",
                  "RMS ATE " + evaluation.unit,
                  "max error " + evaluation.unit,
                  "depth " + evaluation.unit,
                  "ATE % of depth",
                  "scale",
                  "scale drift"};
  const auto paper_cells = [](double keyframes, double points, const auto& map) {
    return std::vector<std::string>{Fixed(keyframes, 1),
                                    Fixed(points, 1),
                                    Fixed(map.keyframes_per_s, 2),
                                    Fixed(map.life_time_s, 2),
                                    Fixed(map.observations_per_frame, 2),
                                    Fixed(map.observations_per_point, 2)};
  };
  const auto add_summary = [&](const char* name, const MapTable& map) {
    std::vector<std::string> row{name};
    for (std::string& cell : paper_cells(map.keyframes, map.map_points, map)) row.push_back(std::move(cell));
    row.resize(table.header.size(), kNothing);
    table.rows.push_back(std::move(row));
  };
  if (evaluation.mean_map) add_summary("mean", *evaluation.mean_map);
  if (evaluation.largest_map) add_summary("largest", *evaluation.largest_map);
  for (const MapEvaluation& map : evaluation.per_map) {
    std::vector<std::string> row{std::to_string(map.map_id)};
    for (std::string& cell : paper_cells(map.keyframes, map.map_points, map)) row.push_back(std::move(cell));
    row.push_back(std::to_string(map.frames));
    row.push_back(Fixed(map.rms_ate, 4));
    row.push_back(Fixed(map.max_error, 4));
    row.push_back(Fixed(map.scene_depth, 2));
    row.push_back(Fixed(map.rms_ate_percent_of_depth, 2));
    row.push_back(Fixed(map.scale, 4));
    row.push_back(Fixed(map.scale_drift, 4));
    table.rows.push_back(std::move(row));
  }
  return table;
}

TextTable MakeSegmentTable(const Evaluation& evaluation) {
  TextTable table;
  table.title = "Errors along the true path";
  table.header = {"from " + evaluation.unit, "frames", "localised", "RMS ATE " + evaluation.unit,
                  "of its own " + evaluation.unit};
  for (const SegmentEvaluation& segment : evaluation.segments) {
    table.rows.push_back({Fixed(segment.begin, 0), std::to_string(segment.frames), std::to_string(segment.localised),
                          Fixed(segment.rms_ate, 4), Fixed(segment.rms_own, 4)});
  }
  return table;
}

TextTable MakeStageTable(std::span<const Evaluation> evaluations) {
  TextTable table;
  table.title = "Stage times";
  table.header = {"stage", "count", "median ms", "p99 ms", "max ms", "mean ms", "sd ms"};
  std::vector<std::string> order;
  for (const Evaluation& evaluation : evaluations) {
    for (const StageEvaluation& stage : evaluation.stages) {
      if (std::find(order.begin(), order.end(), stage.stage) == order.end()) order.push_back(stage.stage);
    }
  }
  for (const std::string& name : order) {
    const std::vector<const StageEvaluation*> stages = StagesNamed(evaluations, name);
    double count = 0.0;
    for (const StageEvaluation* stage : stages) count += static_cast<double>(stage->count);
    table.rows.push_back(
        {name, Fixed(count / static_cast<double>(stages.size()), evaluations.size() == 1 ? 0 : 1),
         Fixed(MeanOf(stages, &StageEvaluation::p50), 2), Fixed(MeanOf(stages, &StageEvaluation::p99), 2),
         Fixed(MeanOf(stages, &StageEvaluation::max), 2), Fixed(MeanOf(stages, &StageEvaluation::mean), 2),
         Fixed(MeanOf(stages, &StageEvaluation::deviation), 2)});
  }
  return table;
}

TextTable MakeJoinTable(std::span<const Evaluation> evaluations) {
  TextTable table;
  table.title = "Merges, loops, relocalisations and recoveries";
  table.num_left = 5;
  const std::string unit = evaluations.empty() ? std::string() : " " + evaluations[0].unit;
  table.header = {"run",
                  "what",
                  "verdict",
                  "maps",
                  "why",
                  "frame",
                  "ATE parts" + unit,
                  "ATE joined" + unit,
                  "joined / parts",
                  "joined / depth",
                  "rotation deg",
                  "position / depth",
                  "duration ms"};
  for (const Evaluation& evaluation : evaluations) {
    for (const JoinEvaluation& join : evaluation.joins) {
      const bool has_ratio = join.ate_joined && join.ate_parts && *join.ate_parts > 0.0;
      table.rows.push_back({ShortName(evaluation.name), std::string(ToString(join.kind)),
                            std::string(ToString(join.verdict)), MapIds(join),
                            join.reason.empty() ? kNothing : join.reason, std::to_string(join.frame_idx),
                            Fixed(join.ate_parts, 4), Fixed(join.ate_joined, 4),
                            Fixed(has_ratio ? Value(*join.ate_joined / *join.ate_parts) : std::nullopt, 2),
                            Fixed(join.ate_joined_depths, 4), Fixed(join.rotation_error_deg, 2),
                            Fixed(join.translation_error_depths, 3), Fixed(join.duration_ms, 1)});
    }
  }
  return table;
}

TextTable MakePrecisionTable(std::span<const Evaluation> evaluations) {
  TextTable table;
  table.title = "Precision and recall";
  table.num_left = 2;
  table.header = {"run", "what", "made", "judged", "false", "precision %", "occasions", "taken", "recall %"};
  for (const Evaluation& e : evaluations) {
    const auto add = [&](const char* what, const JoinCount& count, const std::optional<Recall>& recall) {
      table.rows.push_back({ShortName(e.name), what, std::to_string(count.made), std::to_string(count.judged),
                            std::to_string(count.wrong), PercentText(count.precision()),
                            recall ? std::to_string(recall->occasions) : kNothing,
                            recall ? std::to_string(recall->taken) : kNothing,
                            PercentText(recall ? recall->value() : std::nullopt)});
    };
    add("merges", e.merges, e.merge_recall);
    add("loops", e.loops, std::nullopt);
    add("relocalisations", e.relocalisations, e.relocalisation_recall);
    add("recoveries", e.recoveries, std::nullopt);
  }
  return table;
}

}  // namespace haustra::evaluate
