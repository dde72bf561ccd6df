#include "tools/surface/coverage_truth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/geometry/sim3.h"
#include "tools/evaluate/csv_table.h"

namespace haustra::surface {
namespace {

// Rows of the true wall on both sides of the nearest one, among which the nearest place is looked for: 3 cm.
constexpr int kRowsBeside = 14;

int NearestRow(const TrueWall& truth, const Eigen::Vector3d& point_in_world) {
  int nearest = 0;
  double best = std::numeric_limits<double>::infinity();
  for (int row = 0; row < truth.num_rows(); ++row) {
    const double distance = (truth.middles[row] - point_in_world).squaredNorm();
    if (distance < best) best = distance, nearest = row;
  }
  return nearest;
}

WallView TrueViewAt(const TrueWall& truth, const Eigen::Vector3d& point_in_world) {
  const int row = NearestRow(truth, point_in_world);
  const std::size_t begin = std::size_t(std::max(row - kRowsBeside, 0)) * truth.columns;
  const std::size_t end = std::size_t(std::min(row + kRowsBeside + 1, truth.num_rows())) * truth.columns;
  WallView view = WallView::kNever;
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = begin; i < end; ++i) {
    const double distance = (truth.cells[i].position - point_in_world).squaredNorm();
    if (distance < best) best = distance, view = truth.cells[i].view;
  }
  return view;
}

// Of the cells that were seen so or better.
double TrueShare(const TrueWall& truth, int first_row, int last_row, WallView at_least) {
  const std::size_t begin = std::size_t(first_row) * truth.columns, end = std::size_t(last_row + 1) * truth.columns;
  std::size_t count = 0;
  for (std::size_t i = begin; i < end; ++i) count += truth.cells[i].view >= at_least ? 1 : 0;
  return static_cast<double>(count) / static_cast<double>(end - begin);
}

// Areas of the cells that are false and hang together along or around.
void AddFalsePlaces(const WallGrid& wall, double mm_per_mu, std::vector<char> is_open,
                    CoverageScore::FalsePlaces* places) {
  constexpr int kColumns = WallGrid::kAngles;
  for (int start = 0; start < static_cast<int>(is_open.size()); ++start) {
    if (is_open[start] == 0) continue;
    double area_mm2 = 0.0;
    std::vector<int> stack{start};
    is_open[start] = 0;
    while (!stack.empty()) {
      const int row = stack.back() / kColumns, column = stack.back() % kColumns;
      stack.pop_back();
      area_mm2 += wall.PointOf(row, column).area_mu2 * mm_per_mu * mm_per_mu;
      for (const auto& [r, c] :
           {std::pair(row - 1, column), std::pair(row + 1, column), std::pair(row, (column + 1) % kColumns),
            std::pair(row, (column + kColumns - 1) % kColumns)}) {
        if (r < 0 || r >= wall.num_rows() || is_open[r * kColumns + c] == 0) continue;
        is_open[r * kColumns + c] = 0;
        stack.push_back(r * kColumns + c);
      }
    }
    places->all_mm2 += area_mm2;
    places->largest_mm2 = std::max(places->largest_mm2, area_mm2);
  }
}

void JudgeMap(int map_id, const MapCoverage& coverage, const Sim3& truth_from_map, const TrueWall& truth,
              CoverageScore* score) {
  const WallGrid& wall = *coverage.wall;
  std::vector<char> is_falsely_seen(std::size_t(wall.num_rows()) * WallGrid::kAngles, 0);
  std::vector<char> is_falsely_well = is_falsely_seen;
  for (int row = wall.first_claimed_row(); row < wall.end_claimed_row(); ++row) {
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      const WallView called = wall.cell(row, column).view;
      const WallView known = TrueViewAt(truth, truth_from_map * wall.PointOf(row, column).position_in_map);
      ++score->cells[static_cast<int>(called)][static_cast<int>(known)];
      if (known != WallView::kNever) continue;
      const std::size_t cell = std::size_t(row) * WallGrid::kAngles + column;
      is_falsely_seen[cell] = called != WallView::kNever ? 1 : 0;
      is_falsely_well[cell] = called == WallView::kWell ? 1 : 0;
    }
  }
  AddFalsePlaces(wall, truth_from_map.scale, std::move(is_falsely_seen), &score->falsely_seen);
  AddFalsePlaces(wall, truth_from_map.scale, std::move(is_falsely_well), &score->falsely_well);
  const auto true_row = [&](int row) {
    return NearestRow(truth, truth_from_map * wall.lumen().line.At(wall.LengthOf(row)).position);
  };
  for (const WallCoverage& segment : coverage.segments) {
    const int one = true_row(segment.first_row), other = true_row(segment.end_row - 1);
    const int first = std::min(one, other), last = std::max(one, other);
    const double step_radii = wall.step_mu() / wall.lumen().radius_mu;
    score->segments.push_back({map_id, (segment.first_row - wall.first_claimed_row()) * step_radii,
                               (segment.end_row - wall.first_claimed_row()) * step_radii, segment.well,
                               TrueShare(truth, first, last, WallView::kWell), segment.well + segment.poorly,
                               TrueShare(truth, first, last, WallView::kPoorly)});
  }
}

}  // namespace

Result<TrueWall> ReadTrueWall(const std::string& path) {
  HAUSTRA_ASSIGN(const evaluate::CsvTable table,
                 evaluate::CsvTable::Read(path, {"row", "column", "x_mm", "y_mm", "z_mm", "seen"}));
  TrueWall wall;
  for (std::size_t i = 0; i < table.num_rows(); ++i) {
    HAUSTRA_ASSIGN(const std::int64_t row, table.Integer(i, 0));
    HAUSTRA_ASSIGN(const std::int64_t column, table.Integer(i, 1));
    if (row == 0) wall.columns = static_cast<int>(i) + 1;
    const auto expected = static_cast<std::int64_t>(i);
    if (wall.columns == 0 || row * wall.columns + column != expected || column < 0 || column >= wall.columns) {
      return InvalidArgument(table.Where(i) + "row and column do not follow the line before");
    }
    TrueWall::Cell& cell = wall.cells.emplace_back();
    for (int k = 0; k < 3; ++k) {
      HAUSTRA_ASSIGN(cell.position[k], table.Number(i, 2 + static_cast<std::size_t>(k)));
    }
    const std::string& seen = table.Text(i, 5);
    if (seen == "well") {
      cell.view = WallView::kWell;
    } else if (seen == "poorly") {
      cell.view = WallView::kPoorly;
    } else if (seen != "never") {
      return InvalidArgument(table.Where(i) + "seen is '" + seen + "', not well, poorly or never");
    }
  }
  if (wall.cells.empty() || wall.cells.size() % static_cast<std::size_t>(wall.columns) != 0) {
    return InvalidArgument(path + ": the last row is not complete");
  }
  for (std::size_t begin = 0; begin < wall.cells.size(); begin += static_cast<std::size_t>(wall.columns)) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < wall.columns; ++k) sum += wall.cells[begin + static_cast<std::size_t>(k)].position;
    wall.middles.push_back(sum / wall.columns);
  }
  return wall;
}

std::size_t CoverageScore::num_cells() const {
  std::size_t sum = 0;
  for (const auto& row : cells) {
    for (const std::size_t count : row) sum += count;
  }
  return sum;
}

double CoverageScore::worst_points() const {
  double worst = 0.0;
  for (const Segment& segment : segments) worst = std::max(worst, std::abs(segment.points()));
  return worst;
}

double CoverageScore::worst_seen_points() const {
  double worst = 0.0;
  for (const Segment& segment : segments) worst = std::max(worst, std::abs(segment.seen_points()));
  return worst;
}

double CoverageScore::agreement() const {
  const std::size_t all = num_cells();
  return all > 0 ? static_cast<double>(cells[0][0] + cells[1][1] + cells[2][2]) / static_cast<double>(all) : 0.0;
}

std::optional<CoverageScore> JudgeCoverage(const std::vector<SurfaceMap>& maps,
                                           const std::vector<MapCoverage>& coverages,
                                           const evaluate::Evaluation& evaluation, const TrueWall& truth) {
  CoverageScore score;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const auto map = std::find_if(evaluation.per_map.begin(), evaluation.per_map.end(),
                                  [&](const evaluate::MapEvaluation& each) { return each.map_id == maps[m].map_id; });
    if (map == evaluation.per_map.end() || !map->truth_from_map || !coverages[m].wall) continue;
    JudgeMap(maps[m].map_id, coverages[m], *map->truth_from_map, truth, &score);
  }
  if (score.segments.empty()) return std::nullopt;
  return score;
}

}  // namespace haustra::surface
