#include "tools/evaluate/run_marks.h"

#include <array>
#include <filesystem>
#include <map>

#include "tools/evaluate/csv_table.h"
#include "tools/evaluate/json_input.h"

namespace haustra::evaluate {
namespace {

Status ReadSummary(const std::string& path, bool* has_marks, RunMarks* marks) {
  HAUSTRA_ASSIGN(const nlohmann::json summary, ReadJsonObject(path));
  *has_marks = summary.contains("marks");
  if (!*has_marks) return Status::Ok();
  try {
    const nlohmann::json& all = summary.at("marks");
    for (const nlohmann::json& entry : all.at("set")) {
      RunMark& mark = marks->set.emplace_back();
      mark.label = entry.at("label").get<std::string>();
      mark.map_id = IntegerAt<int>(entry, "map_id");
      mark.session = IntegerAt<std::int64_t>(entry, "session");
      mark.frame_idx = IntegerAt<std::int64_t>(entry, "frame_idx");
      mark.is_of_this_run = entry.at("of_this_run").get<bool>();
      if (!entry.contains("position")) continue;
      const auto position = entry.at("position").get<std::array<double, 3>>();
      mark.position = Eigen::Vector3d(position[0], position[1], position[2]);
    }
    for (const nlohmann::json& entry : all.at("refused")) {
      marks->refused.push_back({entry.at("label").get<std::string>(), IntegerAt<std::int64_t>(entry, "frame_idx"),
                                entry.at("reason").get<std::string>()});
    }
  } catch (const std::exception& error) {
    return InvalidArgument(path + ": marks: " + error.what());
  }
  return Status::Ok();
}

Status ReadSightings(const std::string& path, RunMarks* marks) {
  std::map<std::string, std::size_t> by_label;
  for (std::size_t i = 0; i < marks->set.size(); ++i) by_label[marks->set[i].label] = i;
  HAUSTRA_ASSIGN(const CsvTable table, CsvTable::Read(path, {"frame_idx", "mark", "state", "distance_in_depths"}));
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    HAUSTRA_ASSIGN(const std::int64_t frame_idx, table.Integer(row, 0));
    HAUSTRA_ASSIGN(const double distance, table.Number(row, 3));
    const auto mark = by_label.find(table.Text(row, 1));
    if (mark == by_label.end()) continue;
    marks->sightings.push_back({frame_idx, mark->second, table.Text(row, 2), distance});
  }
  return Status::Ok();
}

}  // namespace

Result<RunMarks> ReadRunMarks(const std::string& folder) {
  const std::filesystem::path root(folder);
  RunMarks marks;
  bool has_marks = false;
  HAUSTRA_TRY(ReadSummary((root / "summary.json").string(), &has_marks, &marks));
  if (has_marks) HAUSTRA_TRY(ReadSightings((root / "marks.csv").string(), &marks));
  return marks;
}

}  // namespace haustra::evaluate
