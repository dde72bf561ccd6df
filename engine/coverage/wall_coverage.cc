#include "engine/coverage/wall_coverage.h"

#include <algorithm>
#include <cmath>

namespace haustra {

WallCoverage CoverageOf(const WallGrid& grid, int first_row, int end_row) {
  WallCoverage coverage{first_row, end_row};
  int well = 0, poorly = 0;
  for (int row = first_row; row < end_row; ++row) {
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      well += grid.cell(row, column).view == WallView::kWell ? 1 : 0;
      poorly += grid.cell(row, column).view == WallView::kPoorly ? 1 : 0;
    }
  }
  const double count = std::max(1, (end_row - first_row) * WallGrid::kAngles);
  coverage.well = well / count;
  coverage.poorly = poorly / count;
  return coverage;
}

std::vector<WallCoverage> CoverageOfSegments(const WallGrid& grid, double segment_radii) {
  const int first = grid.first_claimed_row(), rows = grid.end_claimed_row() - first;
  std::vector<WallCoverage> segments;
  if (rows <= 0) return segments;
  const double length_radii = rows * grid.step_mu() / grid.lumen().radius_mu;
  const int count = std::clamp(static_cast<int>(std::lround(length_radii / segment_radii)), 1, rows);
  for (int i = 0; i < count; ++i) {
    segments.push_back(CoverageOf(grid, first + rows * i / count, first + rows * (i + 1) / count));
  }
  return segments;
}

}  // namespace haustra
