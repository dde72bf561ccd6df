// Tracks from keyframe to keyframe by appearance: a new keyframe is matched with its neighbours by brute force, and the
// matches are verified by the epipolar geometry that they themselves agree on, not by the poses in the map. Guided
// search and the epipolar gate of point_creation.h find what the map expects. A young map that is wrong would be told
// by them again and again that it is right, while its scale runs away; these tracks tell the bundle adjustment
// otherwise. A match with a map point becomes an observation of it. A match of two features without one makes a new
// point, however small its parallax: where the views do not tell its depth, the wall around it does (surface_depth.h).
// Cost: one brute-force match and one RANSAC a neighbour. Deterministic. thread-bound(mapping).
#pragma once

#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/two_view.h"
#include "engine/mapping/surface_depth.h"
#include "engine/mapping/view_pair.h"
#include "engine/noise_model.h"
#include "hal/vision_device.h"

namespace haustra {

class TrackLinker {
 public:
  TrackLinker(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device);

  // Links the keyframe with the first mapping.link_neighbours of the list. Appends the points made to `created` and
  // returns how many observations of older points the keyframe gained.
  int Link(KeyframeHandle handle, std::span<const Covisible> neighbours, Atlas* atlas,
           std::vector<MapPointHandle>* created);

 private:
  bool MatchAndVerify(const Keyframe& a, const Keyframe& b);
  bool IsNear(const Keyframe& keyframe, int feature, const Eigen::Vector3d& position) const;
  bool Place(const Keyframe& a, const Keyframe& b, const Match& match, Eigen::Vector3d* in_map);

  const EngineConfig& config_;
  const NoiseModel& noise_;
  const CameraModel& camera_;
  ViewPair pair_;
  TwoViewRansac ransac_;
  Rng rng_;
  SurfaceDepth surface_;
};

}  // namespace haustra
