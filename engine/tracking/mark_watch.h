// Where a doctor's marks are in the frame that was just tracked, and whether they can be seen: a mark behind a fold
// must not be drawn on the fold. What the frame shows of the map decides: the map points that were found in it are in
// sight, so a mark beyond them is hidden, and one among them, or of whose patch enough was found, is not.
// thread-bound(tracking); rt-safe after construction.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "engine/atlas/local_map.h"
#include "engine/atlas/reframing.h"
#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/tracking/pose_search.h"
#include "hal/core/fixed_vector.h"

namespace haustra {

enum class MarkState : std::uint8_t {
  kOutOfView,  // the camera does not look there, or the border around the scene covers it
  kInFront,    // it can be seen
  kHidden,     // the wall is between, or it is seen from behind
  kUnsure,     // it lies in the picture, but too little of the map was found there
};

std::string_view ToString(MarkState state);

struct MarkSighting {
  MarkId id = 0;
  MarkState state = MarkState::kOutOfView;
  // Not of kOutOfView. Of the others where it is, or would be without the wall.
  float u_px = 0.0f;
  float v_px = 0.0f;
  float distance_in_depths = 0.0f;  // of the camera to it, over the median distance of the points found; always there
};

// All marks of the map that the frame was tracked in; empty without a pose.
using MarkSightings = FixedVector<MarkSighting, kMaxMarks>;

class MarkWatch {
 public:
  // Camera and scene outlive it.
  MarkWatch(const CameraModel& camera, const SceneRegion& scene, int max_features);
  // Of its workspace, on the heap.
  static std::size_t BytesFor(int max_features) { return static_cast<std::size_t>(max_features) * sizeof(Found); }

  // The frame has a pose, and was found to show some points of the map.
  void Look(const LocalMap& map, const PoseEstimate& estimate);
  // The pose is a prediction: what is in the picture is unsure.
  void LookAhead(const LocalMap& map, const SE3& cam_from_map);
  // The map that was looked at last may have changed its unit.
  void Hear(const Reframing& reframing);
  // The frame has no pose.
  void Clear() { sightings_.Clear(); }

  const MarkSightings& sightings() const { return sightings_; }

 private:
  // A map point that the frame shows.
  struct Found {
    Eigen::Vector2d pixel;
    Eigen::Vector3d point_in_cam;
    double distance = 0.0;
  };

  MarkSighting Place(const LocalMark& mark, const SE3& cam_from_map) const;
  MarkState Judge(const LocalMap& map, const LocalMark& mark, const MarkSighting& sighting,
                  const SE3& cam_from_map) const;
  int NumExpected(const LocalMap& map, const LocalMark& mark, const SE3& cam_from_map) const;

  const CameraModel& camera_;
  const SceneRegion& scene_;
  MapId map_id_ = kNoId;       // that was looked at last
  double median_depth_ = 1.0;  // of the last frame that was measured, in its units
  std::vector<Found> found_;
  MarkSightings sightings_;
};

}  // namespace haustra
