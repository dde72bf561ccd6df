// Where the wall is along a ray of a view, and how it lies there: a plane through the map points around it, nearest
// ones first, in inverse depth. Points that a fold in front, the wall beyond its edge or a wrong match puts elsewhere
// have no say (engine/mapping/wall_plane.h). thread-bound(mapping).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/mapping/wall_plane.h"
#include "hal/core/status.h"

namespace haustra {

struct FittedWall {
  double distance = 0.0;                                    // along the ray, map units
  Eigen::Vector3d normal_in_cam = Eigen::Vector3d::Zero();  // towards the camera, unit
  double radius = 0.0;                                      // of the patch, map units
  int num_agreeing = 0;
};

class WallFit {
 public:
  // Distances that differ by less than this share may be of the same wall.
  static constexpr double kSameWall = kWallTolerance;

  // The camera outlives it. All memory is taken here; points beyond max_points are left out.
  WallFit(const CameraModel& camera, int max_points);

  // A view of a map that shows no points yet.
  void Begin(const SE3& cam_from_map);
  // Adds the points that the keyframe sees; the same point again is no second witness.
  void Add(const Keyframe& keyframe, const Atlas& atlas);
  // kFailedPrecondition: too few points are near, or they do not agree. kInvalidArgument: the camera sees nothing
  // there.
  Result<FittedWall> At(const Eigen::Vector2d& pixel);

 private:
  struct Sample {
    MapPointHandle point;
    Eigen::Vector2d pixel;
    Eigen::Vector3d ray;  // unit
    double distance = 0.0;
  };
  struct Near {
    double offset2_px = 0.0;  // from the pixel, squared
    const Sample* sample = nullptr;
  };

  const CameraModel& camera_;
  SE3 cam_from_map_;
  std::vector<Sample> samples_;
  std::vector<Near> near_;
  std::vector<WallWitness> witnesses_;
  std::vector<double> sorted_;
};

}  // namespace haustra
