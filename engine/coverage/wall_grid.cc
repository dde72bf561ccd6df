#include "engine/coverage/wall_grid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace haustra {
namespace {

constexpr double kWallReachShare = 2.2;  // of the radius: farther off is not this wall
constexpr int kRelaxations = 30;
constexpr double kTurn = 2.0 * std::numbers::pi;

int Around(int column) { return (column % WallGrid::kAngles + WallGrid::kAngles) % WallGrid::kAngles; }

}  // namespace

double WallGrid::AngleOf(int column) { return kTurn * (column + 0.5) / kAngles; }

WallGrid::WallGrid(const Lumen& lumen) : lumen_(lumen) {
  const double length = lumen.line.length_mu();
  num_rows_ = std::max(3, static_cast<int>(std::lround(length / (kTurn * lumen.radius_mu / kAngles))));
  step_mu_ = length / num_rows_;
  first_claimed_ = std::clamp(static_cast<int>(std::ceil(lumen.passed_begin_mu / step_mu_ - 0.5)), 0, num_rows_);
  end_claimed_ =
      std::clamp(static_cast<int>(std::ceil(lumen.passed_end_mu / step_mu_ - 0.5)), first_claimed_, num_rows_);
  for (int row = 0; row < num_rows_; ++row) frames_.push_back(lumen.line.At(LengthOf(row)));
  cells_.resize(std::size_t(num_rows_) * kAngles);
  for (WallCell& each : cells_) each.radius_mu = static_cast<float>(lumen.radius_mu);
}

void WallGrid::SetWall(std::span<const WallPatch> patches, int max_hole_cells) {
  struct Sample {
    std::size_t cell;
    float radius;
    float area;
    bool operator<(const Sample& other) const { return cell != other.cell ? cell < other.cell : radius < other.radius; }
  };
  std::vector<Sample> samples;
  for (const WallPatch& patch : patches) {
    const WallCoordinates at = lumen_.line.Of(patch.position_in_map);
    const int row = static_cast<int>(std::floor(at.length_mu / step_mu_));
    if (at.radius_mu > kWallReachShare * lumen_.radius_mu || row < 0 || row >= num_rows_) continue;
    const int column = Around(static_cast<int>(std::floor(at.angle_rad / kTurn * kAngles)));
    samples.push_back(
        {std::size_t(row) * kAngles + column, static_cast<float>(at.radius_mu), static_cast<float>(patch.area_mu2)});
  }
  std::sort(samples.begin(), samples.end());
  for (std::size_t begin = 0; begin < samples.size();) {
    std::size_t end = begin;
    double area = 0.0;
    while (end < samples.size() && samples[end].cell == samples[begin].cell) area += samples[end++].area;
    std::size_t middle = begin;
    double below = samples[begin].area;
    while (middle + 1 < end && below < 0.5 * area) below += samples[++middle].area;
    cells_[samples[begin].cell].radius_mu = samples[middle].radius;
    cells_[samples[begin].cell].is_known = true;
    begin = end;
  }
  FillUnknown();
  FindBridged(max_hole_cells);
}

void WallGrid::FillUnknown() {
  // From the rim of what is known inwards, then evened out.
  std::vector<char> is_filled(cells_.size());
  std::size_t missing = 0;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    is_filled[i] = cells_[i].is_known ? 1 : 0;
    missing += cells_[i].is_known ? 0 : 1;
  }
  if (missing == cells_.size()) return;
  const auto mean_around = [&](int row, int column, bool of_filled) {
    double sum = 0.0;
    int count = 0;
    for (const auto& [dr, dc] : {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
      if (row + dr < 0 || row + dr >= num_rows_) continue;
      const std::size_t other = std::size_t(row + dr) * kAngles + Around(column + dc);
      if (of_filled && is_filled[other] != 1) continue;
      sum += cells_[other].radius_mu;
      ++count;
    }
    return count > 0 ? sum / count : -1.0;
  };
  while (missing > 0) {
    std::vector<std::size_t> filled;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (is_filled[i] != 0) continue;
      const double mean = mean_around(static_cast<int>(i) / kAngles, static_cast<int>(i) % kAngles, true);
      if (mean < 0.0) continue;
      cells_[i].radius_mu = static_cast<float>(mean);
      filled.push_back(i);
    }
    for (const std::size_t i : filled) is_filled[i] = 1;
    missing -= filled.size();
  }
  for (int k = 0; k < kRelaxations; ++k) {
    for (int row = 0; row < num_rows_; ++row) {
      for (int column = 0; column < kAngles; ++column) {
        if (cell(row, column).is_known) continue;
        cell(row, column).radius_mu = static_cast<float>(mean_around(row, column, false));
      }
    }
  }
}

void WallGrid::FindBridged(int max_hole_cells) {
  // How many unknown cells in a row or column lie about this one; the ends of the line close no hole.
  const auto hole = [&](int row, int column, int dr, int dc) {
    int length = 1;
    for (const int sign : {-1, 1}) {
      for (int k = 1; k <= max_hole_cells + 1; ++k) {
        const int r = row + sign * k * dr;
        if (r < 0 || r >= num_rows_) return max_hole_cells + 1;
        if (cell(r, Around(column + sign * k * dc)).is_known) break;
        ++length;
      }
    }
    return length;
  };
  for (int row = 0; row < num_rows_; ++row) {
    for (int column = 0; column < kAngles; ++column) {
      WallCell& here = cell(row, column);
      here.is_bridged = !here.is_known && std::min(hole(row, column, 1, 0), hole(row, column, 0, 1)) <= max_hole_cells;
    }
  }
}

Eigen::Vector3d WallGrid::PositionOf(int row, int column) const {
  const LumenFrame& frame = frames_[row];
  const double angle = AngleOf(column), radius = cell(row, Around(column)).radius_mu;
  return frame.position + radius * (std::cos(angle) * frame.normal + std::sin(angle) * frame.binormal);
}

WallPoint WallGrid::PointOf(int row, int column) const {
  WallPoint point;
  point.position_in_map = PositionOf(row, column);
  const int before = std::max(row - 1, 0), after = std::min(row + 1, num_rows_ - 1);
  const Eigen::Vector3d along = (PositionOf(after, column) - PositionOf(before, column)) / (after - before);
  const Eigen::Vector3d around = 0.5 * (PositionOf(row, column + 1) - PositionOf(row, column - 1));
  // Tangent times around: to the middle.
  const Eigen::Vector3d normal = along.cross(around);
  point.area_mu2 = normal.norm();
  if (point.area_mu2 > 0.0) point.normal_in_map = normal / point.area_mu2;
  return point;
}

double WallGrid::RadiusAt(double length_mu, double angle_rad) const {
  const double u = std::clamp(length_mu / step_mu_ - 0.5, 0.0, num_rows_ - 1.0);
  const double v = angle_rad / kTurn * kAngles - 0.5;
  const int row = std::min(static_cast<int>(u), num_rows_ - 2);
  const double floor_v = std::floor(v);
  const int column = Around(static_cast<int>(floor_v)), next = Around(column + 1);
  const double fu = u - row, fv = v - floor_v;
  return (1.0 - fu) * ((1.0 - fv) * cell(row, column).radius_mu + fv * cell(row, next).radius_mu) +
         fu * ((1.0 - fv) * cell(row + 1, column).radius_mu + fv * cell(row + 1, next).radius_mu);
}

}  // namespace haustra
