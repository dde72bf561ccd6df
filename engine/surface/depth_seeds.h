// A first guess of the wall from sparse points: a plane for every cell of a depth map. rt-safe: no allocation.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "engine/surface/depth_map.h"

namespace haustra {

// A point that the keyframe sees.
struct DepthSeed {
  Eigen::Vector2d cell = Eigen::Vector2d::Zero();      // where on the grid of cells; cell centres at integers
  Eigen::Vector3d bearing = Eigen::Vector3d::UnitZ();  // unit, camera
  double inverse_range = 0.0;                          // 1 / map units, > 0
};

// Where a pixel lies on a grid of so many pixels a cell (depth_map.h).
inline Eigen::Vector2d CellOfPixel(const Eigen::Vector2d& pixel, int step_px) {
  return (pixel.array() - CellCentrePx(0, step_px)).matrix() / step_px;
}

// The seed of a point; false: it is the camera's centre.
inline bool MakeSeed(const Eigen::Vector2d& pixel, int step_px, const Eigen::Vector3d& point_in_cam, DepthSeed* seed) {
  const double range = point_in_cam.norm();
  if (!(range > 0.0)) return false;
  *seed = {CellOfPixel(pixel, step_px), point_in_cam / range, 1.0 / range};
  return true;
}

// A plane p . x = 1 in the camera's coordinates, x in map units. Along a unit ray b its inverse range is p . b, linear
// in b: a plane can be continued from one cell to the next as it is.
using InversePlane = Eigen::Vector3d;

// So many seeds tell of the wall around a cell.
inline constexpr std::size_t kNearestSeeds = 12;

// The seeds of a keyframe by place, so that those around a cell are found without a look at all of them.
// thread-bound(its owner). Memory is taken at construction, and when more seeds come than ever before.
class SeedGrid {
 public:
  // Of so many cells.
  SeedGrid(int width, int height);
  // What construction takes.
  static std::size_t BytesFor(int width, int height) { return 2 * sizeof(int) * (NumBins(width, height) + 1); }

  // They stay where they are while they are looked for.
  void Take(std::span<const DepthSeed> seeds);
  // The nearest kNearestSeeds ones, or all when there are fewer, the nearest first; of equally near ones the first of
  // those that were taken. Valid until the next call.
  std::span<const DepthSeed> FindNearest(const Eigen::Vector2d& cell);

 private:
  static constexpr int kBinCells = 6;
  static constexpr int NumBins(int cells) { return (cells + kBinCells - 1) / kBinCells; }
  static constexpr std::size_t NumBins(int width, int height) { return std::size_t(NumBins(width)) * NumBins(height); }
  static int BinOf(double cell, int num_bins);

  int num_columns_, num_rows_;  // of bins
  std::span<const DepthSeed> seeds_;
  std::vector<int> first_;  // of each bin, in order_; one more at the end
  std::vector<int> order_;  // positions in seeds_, by bin
  std::vector<int> next_;   // workspace of Take
  std::array<DepthSeed, kNearestSeeds> nearest_;
};

// The plane through the seeds nearest to a cell, by least squares with weights that fall with their distance, twice
// reweighted (Cauchy) so that a wrong seed does not bend it. With little spread it leans to the mean range. O(seeds).
// `seeds` is not empty.
InversePlane PlaneFromSeeds(std::span<const DepthSeed> seeds, const Eigen::Vector2d& cell,
                            const Eigen::Vector3d& bearing);

}  // namespace haustra
