// The similarity between two maps from two groups of keyframes, where the matches of one keyframe do not tell it. In a
// young map of living tissue the points are off in depth by a tenth and more, so three pairs of points seldom span the
// true similarity. A pose does not need them: what a keyframe of group a shows, and where map b has it, gives the
// keyframe's pose in map b (P3P; geometry/absolute_pose.h). Its depths in both maps give the scale. Every keyframe of
// group a proposes a similarity in this way; the one that most matches of all of them agree with is refined on these.
// thread-bound(merging), deterministic.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/absolute_pose.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/sim3.h"
#include "engine/geometry/sim3_match.h"
#include "engine/noise_model.h"
#include "engine/optim/sim3_optimizer.h"
#include "engine/place/group_matcher.h"
#include "engine/place/place_config.h"
#include "engine/place/place_excerpt.h"

namespace haustra {

// Of a point that was brought from one map into the other: it is off by the noise of both maps, and by what the wall
// has moved meanwhile. Twice that of a view.
NoiseModel BetweenMaps(const NoiseModel& of_view);

class GroupSimilarity {
 public:
  // Everything named outlives it.
  GroupSimilarity(const EngineConfig& config, const CommonAreaConfig& options, const NoiseModel& noise,
                  const CameraModel& camera, GroupMatcher& matcher);

  struct Estimate {
    Sim3 b_from_a;
    int num_poses = 0;    // keyframes of group a that found one
    int num_matches = 0;  // of all of them
    int num_agreeing = 0;
  };
  // views_b[k] = cam_from_b of the k-th keyframe of group b. False, with `estimate` untouched: the first keyframe of
  // group a finds no pose in map b (this is asked first, and ends most searches), nothing explains enough, two
  // similarities do so alike, or the device failed.
  bool Find(const GroupExcerpt& a, const GroupExcerpt& b, std::span<const SE3> views_b, Rng& rng, Estimate* estimate);

 private:
  // Appends the matches of one keyframe of group a, and what they propose. False: they propose nothing.
  bool AddView(const GroupExcerpt& a, int view_a, const GroupExcerpt& b, Rng& rng);
  // Whether one of the refined similarities explains about as much as the best, and is another one.
  bool HasRival(const Sim3OptimizerResult& best, const Eigen::Vector3d& centre_in_a);

  const CommonAreaConfig& options_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  GroupMatcher& matcher_;
  AbsolutePoseRansac ransac_;
  std::vector<GroupMatch> found_;
  std::vector<Sim3Match> matches_;
  std::vector<Sim3> proposals_;
  std::vector<Sim3OptimizerResult> refined_;  // of the proposals
  std::vector<SE3> views_a_;
  std::vector<std::uint8_t> inliers_;
  std::vector<Eigen::Vector3d> bearings_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<double> tolerance_;
  std::vector<double> ratios_;
};

}  // namespace haustra
