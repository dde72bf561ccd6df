// A straight tube of radius 0.5 map units along z, the depths of keyframes in it, and a run through it: all by
// geometry.
#pragma once

#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>

#include "engine/camera/camera_model.h"
#include "tools/surface/map_coverage.h"

namespace haustra::surface {

inline constexpr double kTubeRadius = 0.5;

struct TubeSurface {
  SurfaceMap map;
  MapSurface surface;
  evaluate::RunOutput run;

  // wall: distance of the wall from the axis along a ray, found by its caller; range along a ray from a place on z.
  explicit TubeSurface(const std::function<double(double, const Eigen::Vector3d&)>& range_at = TubeRange) {
    surface.step_px = 4;
    map.camera.width_px = 240;
    map.camera.height_px = 180;
    map.camera.fx = map.camera.fy = 100.0;
    map.camera.cx = 119.5;
    map.camera.cy = 89.5;
    map.depth_mu = 0.8;
    run.maps = {{0, "active", 13, 100}};
    for (std::int64_t i = 0; i < 61; ++i) {
      evaluate::RunFrame& frame = run.frames.emplace_back();
      frame.frame_idx = i;
      frame.timestamp_ns = 2000000000 + i * 40000000;
      frame.map_id = frame.live_map_id = i == 7 ? -1 : 0;
      // A little off the axis, so that the line has to be found.
      frame.world_from_cam.translation = {0.04, -0.03, 1.0 + 0.05 * static_cast<double>(i)};
    }
    map.keyframes.reserve(13);
    const CameraModel camera = *CameraModel::Create(map.camera);
    for (int k = 0; k < 13; ++k) {
      SurfaceKeyframe& keyframe = map.keyframes.emplace_back();
      keyframe.keyframe_id = k;
      keyframe.cam_from_map = run.frames[5 * k].world_from_cam.Inverse();
      KeyframeDepth& depth = surface.depths.emplace_back();
      depth.keyframe = &keyframe;
      depth.depth = DepthMap(60, 45);
      depth.depth.Clear(0.1);
      for (int i = 0; i < depth.depth.num_cells(); ++i) {
        Eigen::Vector3d bearing;
        if (!camera.Unproject({CellCentrePx(i % 60, 4), CellCentrePx(i / 60, 4)}, &bearing)) continue;
        const double range = range_at(run.frames[5 * k].world_from_cam.translation.z(), bearing);
        if (range > 0.0 && range < 3.0) depth.depth.Set(i, 1.0 / range, 200);
      }
    }
  }
  TubeSurface(const TubeSurface&) = delete;  // keyframes are pointed at

  // From (0.04, -0.03) off the axis.
  static double TubeRange(double, const Eigen::Vector3d& bearing) {
    const Eigen::Vector2d place(0.04, -0.03), way = bearing.head<2>();
    const double a = way.squaredNorm(), b = place.dot(way), c = place.squaredNorm() - kTubeRadius * kTubeRadius;
    return a > 1e-6 ? (-b + std::sqrt(b * b - a * c)) / a : 0.0;
  }
};

}  // namespace haustra::surface
