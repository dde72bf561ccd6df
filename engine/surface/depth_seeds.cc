#include "engine/surface/depth_seeds.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cstddef>

namespace haustra {
namespace {

constexpr std::size_t kNearest = 12;
constexpr int kRounds = 3;
constexpr double kInlier = 0.05;  // relative error of a seed that is as good as the others
constexpr double kLean = 5e-4;    // to the mean range, of the seeds' weight: less than five degrees of spread tell

}  // namespace

InversePlane PlaneFromSeeds(std::span<const DepthSeed> seeds, const Eigen::Vector2d& cell,
                            const Eigen::Vector3d& bearing) {
  struct Near {
    double squared_distance;
    const DepthSeed* seed;
  };
  std::array<Near, kNearest> nearest;
  std::size_t count = 0;
  for (const DepthSeed& seed : seeds) {
    const double squared_distance = (seed.cell - cell).squaredNorm();
    if (count == kNearest && squared_distance >= nearest[count - 1].squared_distance) continue;
    std::size_t place = count < kNearest ? count++ : count - 1;
    for (; place > 0 && nearest[place - 1].squared_distance > squared_distance; --place) {
      nearest[place] = nearest[place - 1];
    }
    nearest[place] = {squared_distance, &seed};
  }
  // Half the weight at the distance of the middle one.
  const double scale = std::max(nearest[count / 2].squared_distance, 1.0);
  std::array<double, kNearest> weight{};
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
