// One map as plain data, taken from the atlas by its owner; what the writers of engine/io make files of.
// Frame: that of the map; lengths in map units (monocular scale, no metric meaning). Pixels: centres at integers.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "engine/geometry/se3.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra {

struct KeyframeExport {
  int id = 0;  // >= 0, unique in the map
  std::int64_t timestamp_ns = 0;
  std::string image_name;  // the frame's file; no blanks
  SE3 cam_from_map;
  std::vector<Eigen::Vector2f> keypoints;
  std::vector<int> point_ids;  // one a keypoint: id of the point that it shows, -1 for none
};

struct PointExport {
  int id = 0;  // >= 0, unique in the map
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::array<std::uint8_t, 3> rgb{128, 128, 128};
  double reprojection_error_px = 0.0;      // mean over the observations
  std::vector<std::pair<int, int>> track;  // keyframe id, index of the keypoint in that keyframe
};

struct MapExport {
  int map_id = 0;
  CameraCalibration calibration;
  std::vector<KeyframeExport> keyframes;
  std::vector<PointExport> points;
};

// Whether ids are unique, numbers finite, names usable, and whether tracks and point_ids say the same in both
// directions. kInvalidArgument names the first entry that does not. O(n log n).
Status Validate(const MapExport& map);

}  // namespace haustra
