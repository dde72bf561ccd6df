// Proof that two keyframes show one piece of wall, and the similarity between their maps (paper, section on place
// recognition and map merging):
//   1. mutual brute-force matches between K_a and the group {K_b, its best covisible keyframes}, features with a point
//   2. Sim(3) by RANSAC with reprojection checks in both directions, non-linear refinement; where that tells none, by
//      the poses of K_a and its neighbours in map b (group_similarity.h)
//   3. guided search of the points of each side in the other, refinement on all that is found; twice
//   4. acceptance: enough inliers, few outliers, enough of what should be visible found, spread over both images,
//      plausible scale and view, small uncertainty, and the consent of K_a's neighbours
// When both keyframes lie in one map the same proof closes a loop. The wall must be there twice, and the correction be
// one that drift can explain. Reads copies, never the atlas (place_excerpt.h); every rejection leaves its reason and
// its counts. thread-bound(merging), deterministic.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/sim3.h"
#include "engine/geometry/sim3_match.h"
#include "engine/geometry/sim3_ransac.h"
#include "engine/noise_model.h"
#include "engine/optim/sim3_optimizer.h"
#include "engine/place/group_matcher.h"
#include "engine/place/group_similarity.h"
#include "engine/place/place_config.h"
#include "engine/place/place_excerpt.h"
#include "engine/place/projected_search.h"
#include "hal/vision_device.h"

namespace haustra {

// In the order of the checks.
enum class CommonAreaVerdict : std::uint8_t {
  kAccepted,
  kFewPoints,         // one of the keyframes carries too few map points
  kDeviceFailed,      // the vision device did not answer
  kFewMatches,        // the descriptors agree in too few places
  kMappedOnce,        // inside one map: most of what matches is one point already
  kNoSimilarity,      // no similarity explains enough of the matches, or two do so alike
  kLowMatchShare,     // the walls look alike, but most matches contradict the similarity
  kFewInliers,        // guided search finds too little more
  kLowInlierShare,    // too many of the guided matches disagree
  kLowVisibleShare,   // too little is found of what should be in view
  kLowSpread,         // what is found covers too little of the images
  kImplausibleScale,  // the maps' units differ too much
  kImplausibleView,   // the keyframes look into different directions
  kUncertain,         // what is found does not hold all seven degrees of freedom
  kUnconfirmed,       // the neighbours of the new keyframe do not see the same
  kImplausibleDrift,  // inside one map: no drift could be as large as this correction
  kAmbiguous,         // another place agrees as well (place_recogniser.h)
  kOutdated,          // the maps were no longer those that it was found in when it came to joining them (mapper.h)
  kNotJoined,         // no time was left, or the graph of a loop has no solution (merger.h); the maps are as they were
};
std::string_view ToString(CommonAreaVerdict verdict);

// A map point of each side that are one.
struct CommonPoint {
  MapPointHandle point_a;
  MapPointHandle point_b;
};

// What was measured up to the check that decided; what comes later is 0.
struct CommonAreaCounts {
  CommonAreaVerdict verdict = CommonAreaVerdict::kFewPoints;
  KeyframeId keyframe_a = kNoId;
  KeyframeId keyframe_b = kNoId;
  MapId map_a = kNoId;
  MapId map_b = kNoId;
  int num_votes = 0;  // of the retrieval, filled by PlaceRecogniser
  int num_points_a = 0;
  int num_points_b = 0;
  int num_matches = 0;
  int num_one = 0;  // inside one map: beside these, matches of what is one point already
  int num_ransac_inliers = 0;
  int num_agreeing = 0;  // of the matches, after refinement
  int num_guided = 0;
  int num_inliers = 0;
  int num_visible = 0;  // the smaller number of points of one side that should be seen from the other
  int num_neighbours = 0;
  int num_confirming = 0;
  double spread = 0.0;  // the smaller one
  double scale = 0.0;   // units of b per unit of a
  double view_angle_deg = 0.0;
  double rotation_sigma_deg = 0.0;
  double scale_sigma = 0.0;
  double position_sigma = 0.0;  // over the median depth
  double drift_share = 0.0;     // inside one map
};

// Where a keyframe stood, and the unit of its map (Atlas::KeyframeScale).
struct KeyframeAnchor {
  SE3 cam_from_map;
  double scale = 1.0;
};

struct CommonArea {
  CommonAreaCounts counts;
  KeyframeHandle keyframe_a;
  KeyframeHandle keyframe_b;
  KeyframeAnchor anchor_a;  // when the area was proven
  KeyframeAnchor anchor_b;
  Sim3 b_from_a;  // points of the map of K_a to that of K_b; from kNoSimilarity on only when it was found
  double median_depth_in_b = 0.0;
  std::vector<CommonPoint> points;  // inliers, each point at most once
};

class CommonAreaVerifier {
 public:
  // Everything named outlives it.
  CommonAreaVerifier(const EngineConfig& config, const CommonAreaConfig& options, const NoiseModel& noise,
                     const CameraModel& camera, const SceneRegion& scene, VisionDevice& device);

  // True when accepted. K_a and its neighbours, K_b and its group: two keyframes.
  bool Verify(const GroupExcerpt& a, const GroupExcerpt& b, Rng& rng, CommonArea* out);

 private:
  struct Pair {
    std::int32_t point_a = -1;  // positions in the excerpts
    std::int32_t point_b = -1;
    std::int32_t feature_a = -1;
    std::int32_t feature_b = -1;
    int view_b = 0;  // keyframe of the group
    int num_directions = 1;
    float similarity = 0.0f;
  };
  struct Sides {
    const GroupExcerpt& a;
    const GroupExcerpt& b;
  };

  CommonAreaVerdict Run(const Sides& sides, Rng& rng, CommonArea* out);
  CommonAreaVerdict FindSimilarity(const Sides& sides, Rng& rng, CommonAreaCounts* counts, Sim3OptimizerResult* result);
  CommonAreaVerdict MatchGroup(const Sides& sides, int* num_one);
  CommonAreaVerdict SearchBothWays(const Sides& sides, const Sim3& b_from_a, int* num_visible);
  // Returns how many were one point already.
  int KeepOneToOne(const Sides& sides);
  // `initial` by value: it may be that of `result`.
  bool Refine(const Sides& sides, Sim3 initial, Sim3OptimizerResult* result);
  void KeepInliers();
  void FillMatches(const Sides& sides);
  double Spread(const Sides& sides) const;
  CommonAreaVerdict CheckView(const Sides& sides, const Sim3OptimizerResult& result, CommonArea* out) const;
  CommonAreaVerdict CheckNeighbours(const Sides& sides, CommonArea* out);
  CommonAreaVerdict CheckDrift(const Sides& sides, CommonArea* out) const;
  void MarkFeaturesWithPoint(const KeyframeExcerpt& keyframe);

  const NoiseModel& noise_;
  NoiseModel tolerated_;      // that of a view, or between two maps (group_similarity.h)
  bool is_by_group_ = false;  // the similarity is that of several keyframes
  const CommonAreaConfig& options_;
  const CameraModel& camera_;
  const SceneRegion& scene_;
  Sim3Ransac ransac_;
  ProjectedSearch search_;
  GroupMatcher matcher_;
  GroupSimilarity group_similarity_;
  Rng group_rng_;

  std::array<SE3, 1> views_a_;
  std::vector<SE3> views_b_;
  std::vector<Pair> pairs_;
  std::vector<Sim3Match> matches_;  // of pairs_
  std::vector<std::uint8_t> inliers_;

  std::vector<GroupMatch> group_matches_;
  std::vector<FoundPoint> found_;
  std::vector<std::uint8_t> allowed_;
  // By point of the excerpts.
  struct Seen {
    int view = -1;
    std::int32_t feature = -1;
  };
  std::vector<Seen> seen_in_b_;          // by the first keyframe of the group that sees it
  std::vector<std::int32_t> seen_in_a_;  // feature of K_a
  std::vector<std::uint8_t> is_used_a_;
  std::vector<std::uint8_t> is_used_b_;
};

}  // namespace haustra
