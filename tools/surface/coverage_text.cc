#include "tools/surface/coverage_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tools/evaluate/number_text.h"

namespace haustra::surface {

using evaluate::Fixed;

namespace {

constexpr double kPlacesPerRadius = 4.0;

std::string Percent(double share) { return Fixed(100.0 * share, 1) + " %"; }

// First and last time at which a cell of these rows was seen, well or poorly; null: none was.
nlohmann::ordered_json TimesOf(const WallGrid& wall, const WallCoverage& rows) {
  nlohmann::ordered_json first, last;
  for (int row = rows.first_row; row < rows.end_row; ++row) {
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      const WallCell& cell = wall.cell(row, column);
      if (cell.view == WallView::kNever) continue;
      first = first.is_null() ? cell.first_s : std::min(first.get<double>(), cell.first_s);
      last = last.is_null() ? cell.last_s : std::max(last.get<double>(), cell.last_s);
    }
  }
  return {{"first_s", first}, {"last_s", last}};
}

// Places on the centre line where the scope was, x y z in the map, four or more a radius.
nlohmann::ordered_json PassedLine(const Lumen& lumen) {
  const double length_mu = lumen.passed_end_mu - lumen.passed_begin_mu;
  const int num_steps = std::max(1, static_cast<int>(std::ceil(kPlacesPerRadius * length_mu / lumen.radius_mu)));
  nlohmann::ordered_json line = nlohmann::ordered_json::array();
  for (int i = 0; i <= num_steps; ++i) {
    const Eigen::Vector3d place = lumen.line.At(lumen.passed_begin_mu + i * length_mu / num_steps).position;
    for (int axis = 0; axis < 3; ++axis) line.push_back(place[axis]);
  }
  return line;
}

}  // namespace

const char* ToText(WallView view) {
  switch (view) {
    case WallView::kWell: return "well";
    case WallView::kPoorly: return "poorly";
    case WallView::kNever: break;
  }
  return "never";
}

std::string ToText(int map_id, const MapCoverage& coverage) {
  std::string text = "map " + std::to_string(map_id) + ": ";
  if (!coverage.wall) return text + "no lumen found: " + coverage.no_lumen + "\n";
  const double radii =
      (coverage.whole.end_row - coverage.whole.first_row) * coverage.wall->step_mu() / coverage.wall->lumen().radius_mu;
  return text + "of the wall along " + Fixed(radii, 1) + " radii of the lumen " + Percent(coverage.whole.well) +
         " seen, " + Percent(coverage.whole.poorly) + " only at a slant or from too far, " +
         Percent(1.0 - coverage.whole.well - coverage.whole.poorly) + " never\n";
}

std::string ToText(const CoverageScore& score) {
  std::string text = "coverage of the wall against the truth:\n";
  for (const CoverageScore::Segment& segment : score.segments) {
    text += "  map " + std::to_string(segment.map_id) + ", " + Fixed(segment.begin_radii, 1) + " to " +
            Fixed(segment.end_radii, 1) + " radii: " + Percent(segment.found) + ", true " + Percent(segment.truth) +
            ", off by " + Fixed(segment.points(), 1) + " points; at all " + Percent(segment.found_seen) + ", true " +
            Percent(segment.truth_seen) + ", off by " + Fixed(segment.seen_points(), 1) + " points\n";
  }
  const auto places = [](const CoverageScore::FalsePlaces& of) {
    return Fixed(of.all_mm2, 0) + " mm2, the largest place " + Fixed(of.largest_mm2, 0) + " mm2\n";
  };
  return text + "  cells that agree             " + Percent(score.agreement()) + "\n  called seen, never was       " +
         places(score.falsely_seen) + "  called seen well, never was  " + places(score.falsely_well);
}

std::string CellsCsv(const WallGrid& wall) {
  std::string text = "row,column,length_radii,angle_deg,x_mu,y_mu,z_mu,seen,first_s,last_s\n";
  for (int row = wall.first_claimed_row(); row < wall.end_claimed_row(); ++row) {
    const double length_mu = wall.LengthOf(row) - wall.first_claimed_row() * wall.step_mu();
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      const WallCell& cell = wall.cell(row, column);
      const Eigen::Vector3d position = wall.PointOf(row, column).position_in_map;
      char line[240];
      std::snprintf(line, sizeof(line), "%d,%d,%.4f,%.2f,%.6g,%.6g,%.6g,%s,", row - wall.first_claimed_row(), column,
                    length_mu / wall.lumen().radius_mu, WallGrid::AngleOf(column) * 180.0 / std::numbers::pi,
                    position.x(), position.y(), position.z(), ToText(cell.view));
      text += line;
      text += cell.view == WallView::kNever ? "," : Fixed(cell.first_s, 3) + "," + Fixed(cell.last_s, 3);
      text += '\n';
    }
  }
  return text;
}

void AddCoverage(const MapCoverage& coverage, nlohmann::ordered_json* map) {
  if (!coverage.wall) {
    (*map)["lumen"] = {{"found", false}, {"reason", coverage.no_lumen}};
    return;
  }
  const WallGrid& wall = *coverage.wall;
  const double step_radii = wall.step_mu() / wall.lumen().radius_mu;
  (*map)["lumen"] = {{"found", true},
                     {"radius_mu", wall.lumen().radius_mu},
                     {"passed_radii", (coverage.whole.end_row - coverage.whole.first_row) * step_radii},
                     {"directions_with_wall", wall.lumen().wall_share},
                     {"line", PassedLine(wall.lumen())}};
  (*map)["wall_coverage"] = coverage.whole.well;
  (*map)["seen_poorly"] = coverage.whole.poorly;
  nlohmann::ordered_json& segments = (*map)["segments"] = nlohmann::ordered_json::array();
  for (const WallCoverage& segment : coverage.segments) {
    nlohmann::ordered_json each = {{"from_radii", (segment.first_row - wall.first_claimed_row()) * step_radii},
                                   {"to_radii", (segment.end_row - wall.first_claimed_row()) * step_radii},
                                   {"wall_coverage", segment.well},
                                   {"seen_poorly", segment.poorly}};
    each.update(TimesOf(wall, segment));
    segments.push_back(std::move(each));
  }
}

nlohmann::ordered_json ToJson(const std::vector<SurfaceMap>& maps, const std::vector<MapCoverage>& coverages) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < maps.size(); ++i) {
    json.push_back({{"map_id", maps[i].map_id}});
    AddCoverage(coverages[i], &json.back());
  }
  return json;
}

nlohmann::ordered_json ToJson(const CoverageScore& score) {
  nlohmann::ordered_json segments = nlohmann::ordered_json::array();
  for (const CoverageScore::Segment& segment : score.segments) {
    segments.push_back({{"map_id", segment.map_id},
                        {"from_radii", segment.begin_radii},
                        {"to_radii", segment.end_radii},
                        {"wall_coverage", segment.found},
                        {"true_wall_coverage", segment.truth},
                        {"points", segment.points()},
                        {"seen", segment.found_seen},
                        {"true_seen", segment.truth_seen},
                        {"seen_points", segment.seen_points()}});
  }
  nlohmann::ordered_json cells;
  for (const WallView called : {WallView::kWell, WallView::kPoorly, WallView::kNever}) {
    for (const WallView known : {WallView::kWell, WallView::kPoorly, WallView::kNever}) {
      cells[std::string("called_") + ToText(called) + "_was_" + ToText(known)] =
          score.cells[static_cast<int>(called)][static_cast<int>(known)];
    }
  }
  return {{"segments", segments},
          {"worst_points", score.worst_points()},
          {"worst_seen_points", score.worst_seen_points()},
          {"agreement", score.agreement()},
          {"cells", cells},
          {"false_mm2", score.falsely_seen.all_mm2},
          {"largest_false_mm2", score.falsely_seen.largest_mm2},
          {"false_well_mm2", score.falsely_well.all_mm2},
          {"largest_false_well_mm2", score.falsely_well.largest_mm2}};
}

}  // namespace haustra::surface
