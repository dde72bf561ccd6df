#include "engine/surface/depth_seeds.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace haustra {
namespace {

constexpr int kRounds = 3;
constexpr double kInlier = 0.05;  // relative error of a seed that is as good as the others
constexpr double kLean = 5e-4;    // to the mean range, of the seeds' weight: less than five degrees of spread tell

}  // namespace

SeedGrid::SeedGrid(int width, int height)
    : num_columns_(NumBins(width)),
      num_rows_(NumBins(height)),
      first_(NumBins(width, height) + 1),
      next_(NumBins(width, height) + 1) {}

// Seeds beyond the border belong to the bin nearest to them.
int SeedGrid::BinOf(double cell, int num_bins) {
  return std::clamp(static_cast<int>(std::floor((cell + 0.5) / kBinCells)), 0, num_bins - 1);
}

void SeedGrid::Take(std::span<const DepthSeed> seeds) {
  seeds_ = seeds;
  std::fill(first_.begin(), first_.end(), 0);
  const auto bin_of = [this](const DepthSeed& seed) {
    return BinOf(seed.cell.y(), num_rows_) * num_columns_ + BinOf(seed.cell.x(), num_columns_);
  };
  for (const DepthSeed& seed : seeds) ++first_[static_cast<std::size_t>(bin_of(seed)) + 1];
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  std::copy(first_.begin(), first_.end(), next_.begin());
  order_.resize(seeds.size());
  for (std::size_t i = 0; i < seeds.size(); ++i) order_[next_[bin_of(seeds[i])]++] = static_cast<int>(i);
}

// Bins around that of the cell, ring by ring, until what lies beyond the last one is farther than what was found.
std::span<const DepthSeed> SeedGrid::FindNearest(const Eigen::Vector2d& cell) {
  struct Near {
    double squared_distance;
    int seed;
    bool operator<(const Near& other) const {
      return std::pair(squared_distance, seed) < std::pair(other.squared_distance, other.seed);
    }
  };
  std::array<Near, kNearestSeeds> found;
  std::size_t count = 0;
  const int column = BinOf(cell.x(), num_columns_), row = BinOf(cell.y(), num_rows_);
  for (int ring = 0; ring < std::max(num_columns_, num_rows_); ++ring) {
    for (int y = std::max(row - ring, 0); y <= std::min(row + ring, num_rows_ - 1); ++y) {
      const bool is_whole_row = y == row - ring || y == row + ring;
      for (int x = column - ring; x <= column + ring; x += is_whole_row || ring == 0 ? 1 : 2 * ring) {
        if (x < 0 || x >= num_columns_) continue;
        const int bin = y * num_columns_ + x;
        for (int i = first_[bin]; i < first_[bin + 1]; ++i) {
          const Near near{(seeds_[order_[i]].cell - cell).squaredNorm(), order_[i]};
          if (count == kNearestSeeds && !(near < found[count - 1])) continue;
          std::size_t place = count < kNearestSeeds ? count++ : count - 1;
          for (; place > 0 && near < found[place - 1]; --place) found[place] = found[place - 1];
          found[place] = near;
        }
      }
    }
    // From the cell to the nearest edge of what was looked at.
    const double left = cell.x() + 0.5 - (column - ring) * kBinCells;
    const double right = (column + ring + 1) * kBinCells - 0.5 - cell.x();
    const double top = cell.y() + 0.5 - (row - ring) * kBinCells;
    const double bottom = (row + ring + 1) * kBinCells - 0.5 - cell.y();
    const double reach = std::max(std::min({left, right, top, bottom}), 0.0);
    if (count == kNearestSeeds && found[count - 1].squared_distance < reach * reach) break;
  }
  for (std::size_t i = 0; i < count; ++i) nearest_[i] = seeds_[found[i].seed];
  return {nearest_.data(), count};
}

InversePlane PlaneFromSeeds(std::span<const DepthSeed> seeds, const Eigen::Vector2d& cell,
                            const Eigen::Vector3d& bearing) {
  struct Near {
    double squared_distance;
    const DepthSeed* seed;
  };
  std::array<Near, kNearestSeeds> nearest;
  std::size_t count = 0;
  for (const DepthSeed& seed : seeds) {
    const double squared_distance = (seed.cell - cell).squaredNorm();
    if (count == kNearestSeeds && squared_distance >= nearest[count - 1].squared_distance) continue;
    std::size_t place = count < kNearestSeeds ? count++ : count - 1;
    for (; place > 0 && nearest[place - 1].squared_distance > squared_distance; --place) {
      nearest[place] = nearest[place - 1];
    }
    nearest[place] = {squared_distance, &seed};
  }
  // Half the weight at the distance of the middle one.
  const double scale = std::max(nearest[count / 2].squared_distance, 1.0);
  std::array<double, kNearestSeeds> weight{};
  double sum = 0.0, mean = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    weight[i] = 1.0 / (1.0 + nearest[i].squared_distance / scale);
    sum += weight[i];
    mean += weight[i] * nearest[i].seed->inverse_range;
  }
  mean /= sum;
  InversePlane plane = mean * bearing;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Identity() * (kLean * sum);
    Eigen::Vector3d right = kLean * sum * mean * bearing;
    for (std::size_t i = 0; i < count; ++i) {
      const DepthSeed& seed = *nearest[i].seed;
      const double error = round == 0 ? 0.0 : (plane.dot(seed.bearing) - seed.inverse_range) / (kInlier * mean);
      const double w = weight[i] / (1.0 + error * error);
      normal += w * seed.bearing * seed.bearing.transpose();
      right += w * seed.inverse_range * seed.bearing;
    }
    plane = normal.ldlt().solve(right);
  }
  return plane;
}

}  // namespace haustra
