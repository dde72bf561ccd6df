// Poses for the frames between the two founding views of a map: when they came there was no map yet, when it stands
// they are found in it by guided search around the motion between the views. They can no longer be answered in time,
// but belong to the final trajectory. thread-bound(mapping).
#pragma once

#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/noise_model.h"
#include "engine/optim/pose_from_matches.h"
#include "engine/tracking/keyframe_proposal.h"
#include "hal/vision_device.h"

namespace haustra {

struct LatePose {
  std::uint32_t frame_index = 0;
  KeyframeId reference_keyframe = kNoId;
  SE3 cam_from_reference;
  double reference_scale = 1.0;
  int num_inliers = 0;
};

// A frame found in a map, with the features that agree.
struct PlacedView {
  struct Sighting {
    MapPointHandle point;
    Eigen::Vector2d pixel;
    double sigma_px = 1.0;
  };
  std::uint32_t frame_index = 0;
  SE3 cam_from_map;
  std::vector<Sighting> sightings;
};

class LatePlacement {
 public:
  LatePlacement(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device);

  // Finds the view in the points of `keyframe`, starting from `guess`. False when too few agree.
  bool Place(const ProposedView& view, const SE3& guess, KeyframeHandle keyframe, const Atlas& atlas, PlacedView* out);

 private:
  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  VisionDevice& device_;
  PoseFromMatches pose_from_matches_;
  std::vector<GuidedQuery> queries_;
  std::vector<MapPointHandle> query_points_;
  std::vector<Match> matches_;
};

}  // namespace haustra
