// A map of two keyframes and two points, each seen once or twice, for the tests of the writers.
#pragma once

#include "engine/io/map_export.h"

namespace haustra {

inline MapExport SmallMap() {
  MapExport map;
  map.map_id = 7;
  map.calibration.kind = CameraModelKind::kKannalaBrandt;
  map.calibration.width_px = 720;
  map.calibration.height_px = 540;
  map.calibration.fx = 398.2;
  map.calibration.fy = 397.6;
  map.calibration.cx = 362.4;
  map.calibration.cy = 268.1;
  map.calibration.coefficients = {-0.045, 0.008, -0.0031, 0.0005};
  KeyframeExport first;
  first.id = 0;
  first.image_name = "frames/000000.jpg";
  first.keypoints = {{10.25f, 20.5f}, {30.0f, 40.0f}};
  first.point_ids = {5, -1};
  KeyframeExport second;
  second.id = 12;
  second.timestamp_ns = 480000000;
  second.image_name = "frames/000012.jpg";
  second.cam_from_map = SE3(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Eigen::Vector3d(1, 2, 3));
  second.keypoints = {{1.0f, 2.0f}, {11.0f, 22.0f}, {33.0f, 44.0f}};
  second.point_ids = {9, -1, 5};
  map.keyframes = {first, second};
  PointExport a;
  a.id = 5;
  a.position = {0.5, -1.25, 4.0};
  a.rgb = {200, 100, 50};
  a.reprojection_error_px = 0.75;
  a.track = {{0, 0}, {12, 2}};
  PointExport b;
  b.id = 9;
  b.position = {0.0, 0.0, 2.0};
  b.track = {{12, 0}};
  map.points = {a, b};
  return map;
}

}  // namespace haustra
