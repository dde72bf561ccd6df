// A textured wall as a formula, and pictures of it by casting a ray a pixel: the truth for tests of depth. Shares with
// the code under test the camera model alone.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "hal/core/views.h"

namespace haustra {

inline constexpr int kStep = 4;  // pixels a cell

// Distance from a point along a unit direction to the wall; 0: none.
using Wall = std::function<double(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction)>;

// n . x = offset.
inline Wall PlaneWall(const Eigen::Vector3d& normal, double offset) {
  return [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const double along = normal.dot(direction);
    const double distance = (offset - normal.dot(origin)) / along;
    return std::abs(along) > 1e-9 && distance > 0.0 ? distance : 0.0;
  };
}

// From the inside.
inline Wall SphereWall(const Eigen::Vector3d& centre, double radius) {
  return [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const Eigen::Vector3d to_origin = origin - centre;
    const double half = to_origin.dot(direction);
    const double root = half * half - to_origin.squaredNorm() + radius * radius;
    return root > 0.0 ? -half + std::sqrt(root) : 0.0;
  };
}

// About the z axis, from the inside.
inline Wall TubeWall(double radius) {
  return [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const Eigen::Vector2d p = origin.head<2>(), d = direction.head<2>();
    const double a = d.squaredNorm(), half = p.dot(d);
    const double root = half * half - a * (p.squaredNorm() - radius * radius);
    return a > 1e-6 && root > 0.0 ? (-half + std::sqrt(root)) / a : 0.0;
  };
}

// Smooth noise of a cell size, fixed to the points of space.
inline double SmoothNoise(const Eigen::Vector3d& point, double cell) {
  const Eigen::Vector3d q = point / cell;
  const Eigen::Vector3i low = q.array().floor().cast<int>();
  double sum = 0.0;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3i corner = low + Eigen::Vector3i(k & 1, (k >> 1) & 1, k >> 2);
    std::uint32_t hash = static_cast<std::uint32_t>(corner.x()) * 374761393u +
                         static_cast<std::uint32_t>(corner.y()) * 668265263u +
                         static_cast<std::uint32_t>(corner.z()) * 2147483647u;
    hash = (hash ^ (hash >> 13)) * 1274126177u;
    hash ^= hash >> 16;
    double weight = 1.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double t = 1.0 - std::abs(q[axis] - corner[axis]);
      weight *= t * t * (3.0 - 2.0 * t);
    }
    sum += weight * (hash % 1024) / 1023.0;
  }
  return sum;
}

struct Picture {
  std::vector<std::uint8_t> pixels;
  int width = 0, height = 0;
  ImageView view() const { return {pixels.data(), width, height, width, PixelFormat::kGrey8}; }
};

// `gain`: of the light, so that pictures of a moving lamp differ. `texture`: side of its coarser grains.
inline Picture TakePicture(const Wall& wall, const CameraModel& camera, const SE3& cam_from_map, double texture,
                           double gain) {
  Picture picture{{}, camera.width_px(), camera.height_px()};
  const SE3 map_from_cam = cam_from_map.Inverse();
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      Eigen::Vector3d bearing = Eigen::Vector3d::UnitZ();
      const bool is_seen = camera.Unproject(Eigen::Vector2d(x, y), &bearing);
      const Eigen::Vector3d direction = map_from_cam.rotation * bearing;
      const double distance = is_seen ? wall(map_from_cam.translation, direction) : 0.0;
      double grey = 0.0;
      if (distance > 0.0) {
        const Eigen::Vector3d point = map_from_cam.translation + distance * direction;
        grey = gain * (40.0 + 90.0 * SmoothNoise(point, texture) + 60.0 * SmoothNoise(point, 0.4 * texture));
      }
      picture.pixels.push_back(static_cast<std::uint8_t>(std::min(grey + 0.5, 240.0)));
    }
  }
  return picture;
}

inline CameraCalibration SmallFisheye() {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kKannalaBrandt;
  calibration.width_px = 200;
  calibration.height_px = 160;
  calibration.fx = calibration.fy = 110.0;
  calibration.cx = 99.5;
  calibration.cy = 79.5;
  calibration.coefficients = {-0.03, 0.006, -0.002, 0.0003};
  return calibration;
}

inline CameraCalibration SmallPinhole() {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kPinhole;
  calibration.width_px = 200;
  calibration.height_px = 160;
  calibration.fx = calibration.fy = 180.0;
  calibration.cx = 99.5;
  calibration.cy = 79.5;
  calibration.coefficients = {-0.1, 0.02};
  return calibration;
}

}  // namespace haustra
