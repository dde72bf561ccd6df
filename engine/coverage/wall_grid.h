// The wall of a lumen unrolled: its distance from the centre line on a grid of length by angle. Cells are about square.
// Map frame, map units. Memory is taken at construction. Value type, reentrant; rt-safe but for construction, copies
// and SetWall.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/coverage/lumen_finder.h"

namespace haustra {

enum class WallView : std::uint8_t { kNever, kPoorly, kWell };

// Of the wall: a piece of it with its middle.
struct WallPatch {
  Eigen::Vector3d position_in_map = Eigen::Vector3d::Zero();
  double area_mu2 = 0.0;
};

struct WallCell {
  float radius_mu = 0.0f;   // of the wall; where it is not known, from the cells around
  bool is_known = false;    // the wall was reconstructed here
  bool is_bridged = false;  // a hole of the reconstruction, no longer than options.max_hole_cells
  WallView view = WallView::kNever;
  // When it was seen in this way, s; only where it was.
  double first_s = 0.0, last_s = 0.0;
};

// Place of the wall with what is around it.
struct WallPoint {
  Eigen::Vector3d position_in_map = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal_in_map = Eigen::Vector3d::UnitX();  // unit, into the lumen
  double area_mu2 = 0.0;                                     // of the cell's wall, up and down the folds
};

class WallGrid {
 public:
  static constexpr int kAngles = 64;

  // The whole line has rows; those of the passed part may be claimed.
  explicit WallGrid(const Lumen& lumen);

  const Lumen& lumen() const { return lumen_; }
  int num_rows() const { return num_rows_; }
  double step_mu() const { return step_mu_; }
  // Rows [first, end) lie in the part that the scope passed.
  int first_claimed_row() const { return first_claimed_; }
  int end_claimed_row() const { return end_claimed_; }
  bool is_claimed(int row) const { return row >= first_claimed_ && row < end_claimed_; }
  double LengthOf(int row) const { return (row + 0.5) * step_mu_; }
  static double AngleOf(int column);
  WallCell& cell(int row, int column) { return cells_[std::size_t(row) * kAngles + column]; }
  const WallCell& cell(int row, int column) const { return cells_[std::size_t(row) * kAngles + column]; }

  // The wall where the patches say: the radius that half of a cell's area lies within. Between them it is filled from
  // around; holes of up to max_hole_cells along or around become bridged. Patches far off the line are left out.
  void SetWall(std::span<const WallPatch> patches, int max_hole_cells);

  WallPoint PointOf(int row, int column) const;
  // Between four cells; clamped to the ends of the line.
  double RadiusAt(double length_mu, double angle_rad) const;

 private:
  Eigen::Vector3d PositionOf(int row, int column) const;
  void FillUnknown();
  void FindBridged(int max_hole_cells);

  Lumen lumen_;
  int num_rows_ = 0;
  double step_mu_ = 0.0;
  int first_claimed_ = 0, end_claimed_ = 0;
  std::vector<LumenFrame> frames_;  // of the rows
  std::vector<WallCell> cells_;
};

}  // namespace haustra
