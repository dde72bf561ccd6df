// Which cells of a wall a frame looked at. thread-bound(its owner). Observe allocates nothing.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/coverage/coverage_options.h"
#include "engine/coverage/wall_grid.h"
#include "engine/geometry/se3.h"
#include "hal/core/views.h"

namespace haustra {

class WallObserver {
 public:
  // mask: 255 where pictures show the scene, kGrey8, of the camera's size, copied; empty: everywhere.
  // options.Validate() must be ok.
  WallObserver(const CameraModel& camera, ImageView mask, const CoverageOptions& options);

  // Marks the claimed cells of the grid that a frame of this pose shows: in the picture, facing it, nearer than
  // far_radii and not hidden by the wall itself. Seen well is what is near and square enough. Cells are better known
  // afterwards or as they were; those without a wall stay as they are. time_s: of the frame, not before those of
  // earlier calls. Cost: about 10 ms on one x86-64 core.
  void Observe(const SE3& cam_from_map, double time_s, WallGrid* grid) const;

 private:
  bool IsInPicture(const Eigen::Vector3d& point_in_cam) const;
  bool IsHidden(const WallGrid& grid, const Eigen::Vector3d& point_in_map, double length_mu,
                const Eigen::Vector3d& centre_in_map) const;

  CameraModel camera_;
  CoverageOptions options_;
  std::vector<std::uint8_t> is_scene_;  // of the picture; empty: everywhere
};

}  // namespace haustra
