#include "tools/evaluate/trajectory_error.h"

#include <algorithm>
#include <cmath>

namespace haustra::evaluate {

double Alignment::rms() const { return std::sqrt(squared_error / static_cast<double>(count)); }

std::optional<Alignment> Align(std::span<const PosePair> poses, std::size_t min_frames) {
  if (poses.size() < min_frames) return std::nullopt;
  std::vector<Eigen::Vector3d> estimated, truth;
  estimated.reserve(poses.size());
  truth.reserve(poses.size());
  for (const PosePair& pose : poses) {
    estimated.push_back(pose.estimated.translation);
    truth.push_back(pose.truth.translation);
  }
  Alignment alignment;
  if (!AlignSim3(estimated, truth, &alignment.truth_from_map)) return std::nullopt;
  alignment.count = poses.size();
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    const double squared = (alignment.truth_from_map * estimated[i] - truth[i]).squaredNorm();
    alignment.squared_error += squared;
    alignment.max_error = std::max(alignment.max_error, std::sqrt(squared));
  }
  return alignment;
}

std::optional<double> FindScaleDrift(std::span<const PosePair> poses) {
  constexpr std::size_t kMinQuarterFrames = 5;
  const std::size_t quarter = poses.size() / 4;
  const std::optional<Alignment> first = Align(poses.first(quarter), kMinQuarterFrames);
  const std::optional<Alignment> last = Align(poses.last(quarter), kMinQuarterFrames);
  if (!first || !last) return std::nullopt;
  return last->truth_from_map.scale / first->truth_from_map.scale;
}

}  // namespace haustra::evaluate
