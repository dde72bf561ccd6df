// Whether two frames see the same piece of the scene, by the ground truth: the geometric criterion behind recall.
//
// The view volume of a frame is the part of space in front of it where its scene can lie: the rays of its image, from
// half to one and a half times the depth of the scene there. Two frames share a view when
//   - their optical axes are less than 45 degrees apart, and
//   - at least 30 % of the view volume of each lies in that of the other.
// The volume is sampled by points of equal weight: a grid of pixels, on spheres that part it into shells of equal
// volume. What the criterion cannot see: a fold of the wall between the two cameras. reentrant.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"

namespace haustra::evaluate {

inline constexpr double kMinSharedVolume = 0.30;
inline constexpr double kMaxSharedAngleDeg = 45.0;

// A camera where it truly was.
struct View {
  SE3 world_from_cam;
  double depth = 0.0;  // typical distance of what it sees, unit of the pose
};

class SharedView {
 public:
  explicit SharedView(const CameraModel& camera);

  // Share of a's view volume that lies in b's, [0, 1].
  double VolumeInCommon(const View& a, const View& b) const;
  bool Holds(const View& a, const View& b) const;

 private:
  CameraModel camera_;
  std::vector<Eigen::Vector3d> samples_;  // in the camera, for depth 1
};

// Angle between the optical axes.
double AxisAngleDeg(const SE3& world_from_cam_a, const SE3& world_from_cam_b);

// Positions of the views that are worth comparing: the first, and each that has moved by a tenth of the depth or turned
// by 10 degrees since the one before.
std::vector<std::size_t> SelectViews(const std::vector<View>& views);

}  // namespace haustra::evaluate
