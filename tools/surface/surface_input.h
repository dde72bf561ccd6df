// What a surface is made from, as a run has left it: keyframes with poses, the points that they see, the camera.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/geometry/se3.h"
#include "engine/surface/view_selection.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "tools/evaluate/run_output.h"

namespace haustra::surface {

struct SurfaceKeyframe {
  std::int64_t keyframe_id = 0;
  std::string image_name;  // as the sequence names it, '_' for a blank
  SE3 cam_from_map;
  SeeingView view;                      // its centre, and the points that it sees
  std::vector<Eigen::Vector2d> pixels;  // of each of these points; pixel centres at integers
};

struct SurfaceMap {
  int map_id = 0;
  std::string poses_checksum;              // report::ChecksumOfPoses
  CameraCalibration camera;                // with which the map was made
  double depth_mu = 0.0;                   // median distance of the points
  std::vector<SurfaceKeyframe> keyframes;  // by id
};

// The maps that exist at the end and have an export, by id. A loaded procedure's keyframes are among them. Errors of
// report::ReadMapModel; kNotFound: there is no such map.
Result<std::vector<SurfaceMap>> ReadSurfaceMaps(const evaluate::RunOutput& run);

}  // namespace haustra::surface
