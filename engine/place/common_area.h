// Proof that two keyframes show one piece of wall, and the similarity between their maps (system.md 9; paper, section
// on place recognition and map merging):
//   1. mutual brute-force matches between K_a and the group {K_b, its best covisible keyframes}, features with a point
//   2. Sim(3) by RANSAC with reprojection checks in both directions, non-linear refinement
//   3. guided search of the points of each side in the other, refinement on all that is found; twice
//   4. acceptance: enough inliers, few outliers, enough of what should be visible found, spread over both images,
//      plausible scale and view, small uncertainty, and the consent of K_a's neighbours
// When both keyframes lie in one map the same proof closes a loop, and the correction must be one that drift can
// explain. Nothing is written; every rejection leaves its reason and its counts. thread-bound(mapping), deterministic.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/sim3.h"
#include "engine/geometry/sim3_match.h"
#include "engine/geometry/sim3_ransac.h"
#include "engine/optim/sim3_optimizer.h"
#include "engine/place/place_config.h"
#include "engine/place/projected_search.h"
#include "hal/vision_device.h"

namespace haustra {

// In the order of the checks.
enum class CommonAreaVerdict : std::uint8_t {
  kAccepted,
  kFewPoints,         // one of the keyframes carries too few map points
  kDeviceFailed,      // the vision device did not answer
  kFewMatches,        // the descriptors agree in too few places
  kNoSimilarity,      // no similarity explains enough of the matches
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

struct CommonArea {
  CommonAreaCounts counts;
  KeyframeHandle keyframe_a;
  KeyframeHandle keyframe_b;
  Sim3 b_from_a;  // points of the map of K_a to that of K_b; from kNoSimilarity on only when it was found
  double median_depth_in_b = 0.0;
  std::vector<CommonPoint> points;  // inliers, each point at most once
};

class CommonAreaVerifier {
 public:
  // Everything named outlives it.
  CommonAreaVerifier(const EngineConfig& config, const CommonAreaConfig& options, const CameraModel& camera,
                     VisionDevice& device);

  // True when accepted. Both keyframes are alive and different.
  bool Verify(const Atlas& atlas, KeyframeHandle keyframe_a, KeyframeHandle keyframe_b, Rng& rng, CommonArea* out);

 private:
  struct Pair {
    MapPointHandle point_a;
    MapPointHandle point_b;
    std::int32_t feature_a = -1;
    std::int32_t feature_b = -1;
    int view_b = 0;  // index in group_
    int num_directions = 1;
    float similarity = 0.0f;
  };

  CommonAreaVerdict Run(const Atlas& atlas, Rng& rng, CommonArea* out);
  CommonAreaVerdict MatchGroup(const Atlas& atlas);
  CommonAreaVerdict SearchBothWays(const Atlas& atlas, const Sim3& b_from_a, int* num_visible);
  void KeepOneToOne();
  // `initial` by value: it may be that of `result`.
  bool Refine(const Atlas& atlas, Sim3 initial, Sim3OptimizerResult* result);
  void KeepInliers();
  void FillMatches(const Atlas& atlas);
  double Spread(const Atlas& atlas) const;
  CommonAreaVerdict CheckView(const Atlas& atlas, const Sim3OptimizerResult& result, CommonArea* out) const;
  CommonAreaVerdict CheckNeighbours(const Atlas& atlas, CommonArea* out);
  CommonAreaVerdict CheckDrift(const Atlas& atlas, CommonArea* out) const;
  void MarkFeaturesWithPoint(const Keyframe& keyframe);

  const EngineConfig& config_;
  const CommonAreaConfig& options_;
  const CameraModel& camera_;
  VisionDevice& device_;
  Sim3Ransac ransac_;
  ProjectedSearch search_;
  PointCollector collector_;

  KeyframeHandle keyframe_a_;
  std::vector<KeyframeHandle> group_;
  std::array<SE3, 1> views_a_;
  std::vector<SE3> views_b_;
  std::vector<Pair> pairs_;
  std::vector<Sim3Match> matches_;  // of pairs_
  std::vector<std::uint8_t> inliers_;

  std::vector<std::int32_t> features_a_;
  std::vector<std::int32_t> features_b_;
  std::vector<Match> found_matches_;
  std::vector<FoundPoint> found_;
  std::vector<std::uint8_t> allowed_;
  std::vector<MapPointHandle> points_;
  std::vector<KeyframeHandle> wide_group_;
  std::vector<Covisible> covisible_;
  std::vector<std::uint8_t> is_used_;  // by point slot, both sides
};

}  // namespace haustra
