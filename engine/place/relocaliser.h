// Where a frame without a pose stands in a stored map: retrieves the most similar keyframes, matches the
// frame by brute force against the points of each and its best covisible ones, pose by RANSAC, guided search around it,
// robust pose optimisation, acceptance. Then its rivals are asked: when another place of the same map agrees as well
// and says something else, nobody knows. Reads the atlas only; runs on request of the tracker, whose own recovery knows
// just the window around the last keyframe. thread-bound(mapping), deterministic for one seed.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/geometry/rng.h"
#include "engine/noise_model.h"
#include "engine/optim/pose_from_matches.h"
#include "engine/place/place_config.h"
#include "engine/place/projected_search.h"
#include "engine/place/retrieval.h"
#include "hal/vision_device.h"

namespace haustra {

// In the order of the checks.
enum class RelocalisationVerdict : std::uint8_t {
  kAccepted,
  kNoCandidate,     // nothing looks alike
  kDeviceFailed,    // the vision device did not answer
  kFewMatches,      // the descriptors agree in too few places
  kNoPose,          // no pose explains enough of the matches
  kLowMatchShare,   // the wall looks alike, but most matches contradict the pose
  kFewInliers,      // guided search finds too little more
  kLowInlierShare,  // too many of the guided matches disagree
  kLowSpread,       // what is found covers too little of the image
  kUncertain,       // what is found does not hold all six degrees of freedom
  kAmbiguous,       // another place of the same map agrees as well
};
std::string_view ToString(RelocalisationVerdict verdict);

// Of one candidate; what comes after the check that decided is 0.
struct RelocalisationCounts {
  RelocalisationVerdict verdict = RelocalisationVerdict::kNoCandidate;
  KeyframeId keyframe = kNoId;
  MapId map_id = kNoId;
  int num_votes = 0;
  int num_matches = 0;
  int num_ransac_inliers = 0;
  int num_agreeing = 0;  // of the matches, after refinement
  int num_guided = 0;
  int num_inliers = 0;
  double spread = 0.0;
  double rotation_sigma_deg = 0.0;
  double position_sigma = 0.0;  // over the median depth
};

struct Relocalisation {
  SE3 cam_from_map;
  MapHandle map;
  KeyframeHandle reference;   // of those searched, the one that shares most points with the frame
  double median_depth = 0.0;  // of the points seen, map units
  RelocalisationCounts counts;
};

class Relocaliser {
 public:
  // Everything named outlives it.
  Relocaliser(const EngineConfig& config, const RelocalisationConfig& options, const NoiseModel& noise,
              const RetrievalConfig& retrieval_options, const CameraModel& camera, const SceneRegion& scene,
              VisionDevice& device, KeyframeRetrieval& retrieval);

  // True when accepted; `out` then says where. `tried`, replaced, holds every candidate with its reason (not the
  // rivals), or one entry kNoCandidate or kDeviceFailed. Cost: one retrieval and max_candidates brute-force matches of
  // the whole frame; when a place is accepted, at most as many again.
  bool Relocalise(const Atlas& atlas, const FrameFeatures& features, Relocalisation* out,
                  std::vector<RelocalisationCounts>* tried);

 private:
  struct Pair {
    std::int32_t feature_idx = -1;
    MapPointHandle point;
  };

  RelocalisationVerdict Try(const Atlas& atlas, const FrameFeatures& features, KeyframeHandle candidate,
                            Relocalisation* out);
  void ListPairs(const Atlas& atlas, const FrameFeatures& features);
  bool IsTried(KeyframeHandle keyframe) const;
  RelocalisationVerdict TryNext(const Atlas& atlas, const FrameFeatures& features, const RetrievalCandidate& candidate,
                                Relocalisation* out);
  bool HasRival(const Atlas& atlas, const FrameFeatures& features, std::size_t accepted_idx,
                const Relocalisation& accepted);
  RelocalisationVerdict CheckCertainty(const Atlas& atlas, const PoseOptimizerResult& result,
                                       Relocalisation* out) const;
  void ChooseReference(const Atlas& atlas, Relocalisation* out) const;

  const EngineConfig& config_;
  const NoiseModel& noise_;
  const RelocalisationConfig& options_;
  const RetrievalConfig& retrieval_options_;
  const SceneRegion& scene_;
  VisionDevice& device_;
  KeyframeRetrieval& retrieval_;
  PoseFromMatches pose_from_matches_;
  ProjectedSearch search_;
  PointCollector collector_;
  Rng rng_;

  std::vector<std::int32_t> strongest_;
  std::vector<RetrievalCandidate> candidates_;
  Relocalisation rival_;
  std::vector<KeyframeHandle> group_;
  std::vector<KeyframeHandle> wide_group_;
  std::vector<KeyframeHandle> tried_;
  std::vector<Covisible> covisible_;
  std::vector<MapPointHandle> points_;
  std::vector<SearchedPoint> searched_;  // of points_
  std::vector<DescriptorRef> refs_;
  std::vector<Match> matches_;
  std::vector<FoundPoint> found_;
  std::vector<Pair> pairs_;
  std::vector<Eigen::Vector3d> bearings_;
};

}  // namespace haustra
