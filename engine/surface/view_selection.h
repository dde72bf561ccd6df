// Which keyframes help to see the depth of another one: those that share points with it under a useful angle.
// reentrant; allocates, not rt-safe. Cost: O(keyframes * points).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace haustra {

// A point of the map as a keyframe sees it.
struct SeenPoint {
  std::int64_t point_id = 0;
  Eigen::Vector3d position_in_map = Eigen::Vector3d::Zero();  // map units
};

struct SeeingView {
  Eigen::Vector3d centre_in_map = Eigen::Vector3d::Zero();  // map units
  std::vector<SeenPoint> points;                            // by point_id, strictly increasing
};

// A view that scores less is no help: what a dozen well-placed points count.
inline constexpr double kMinSourceScore = 10.0;

// At most `max_sources` other views, the best first. A shared point counts by the angle between its two rays: one at
// 8 degrees, falling off as a Gaussian with 3 degrees below and 12 above. Less parallax says little about depth, and
// with more the pictures become unlike (Yao et al. 2018, "MVSNet", section 4.1; the angles are ours, for the short
// distances of an endoscope). Views of a score below `min_score` are no help.
std::vector<int> SelectSources(std::span<const SeeingView> views, int reference, int max_sources, double min_score);

}  // namespace haustra
