// Random geometry with known truth for the estimators' tests.
#pragma once

#include <cmath>
#include <numbers>

#include "engine/camera/camera_model.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"
#include "tests/sanitized.h"

namespace haustra::test {

// Trials of a statistical test: a fifth under a sanitizer, which looks for other faults and is thirty times slower.
constexpr int Trials(int count) { return kIsSanitized ? count / 5 : count; }

inline double Gaussian(Rng& rng) {
  // Box and Muller; 1 - Uniform() is never zero.
  return std::sqrt(-2.0 * std::log(1.0 - rng.Uniform())) * std::cos(2.0 * std::numbers::pi * rng.Uniform());
}

inline Eigen::Vector3d GaussianVector(Rng& rng, double sigma) {
  const double x = Gaussian(rng), y = Gaussian(rng), z = Gaussian(rng);
  return sigma * Eigen::Vector3d(x, y, z);
}

inline Eigen::Vector3d RandomDirection(Rng& rng) { return GaussianVector(rng, 1.0).normalized(); }

// Rotation by up to `max_angle_rad` about a random axis.
inline Eigen::Quaterniond RandomRotation(Rng& rng, double max_angle_rad) {
  const Eigen::Vector3d axis = RandomDirection(rng);
  return ExpSO3(rng.Uniform(0.0, max_angle_rad) * axis);
}

inline SE3 RandomPose(Rng& rng, double max_angle_rad, double max_translation) {
  const Eigen::Quaterniond rotation = RandomRotation(rng, max_angle_rad);
  const Eigen::Vector3d direction = RandomDirection(rng);
  return SE3(rotation, rng.Uniform(0.0, max_translation) * direction);
}

// Turned off its direction by a Gaussian of `sigma_rad` along each of two axes.
inline Eigen::Vector3d NoisyBearing(Rng& rng, const Eigen::Vector3d& bearing, double sigma_rad) {
  const Eigen::Vector3d u = bearing.unitOrthogonal(), v = bearing.cross(u);
  const double along_u = Gaussian(rng), along_v = Gaussian(rng);
  return (bearing + sigma_rad * (along_u * u + along_v * v)).normalized();
}

// The rendered sequences' camera: 720x540, Kannala-Brandt.
inline CameraCalibration ColonCalibration() {
  CameraCalibration c;
  c.kind = CameraModelKind::kKannalaBrandt;
  c.width_px = 720;
  c.height_px = 540;
  c.fx = 398.2;
  c.fy = 397.6;
  c.cx = 362.4;
  c.cy = 268.1;
  c.coefficients = {-0.045, 0.008, -0.0031, 0.0005};
  return c;
}

inline CameraModel ColonCamera() { return CameraModel::Create(ColonCalibration()).value(); }

// A direction inside the image of the camera.
inline Eigen::Vector3d RandomBearing(Rng& rng, const CameraModel& camera) {
  Eigen::Vector3d bearing;
  for (;;) {
    const double u = rng.Uniform(0.0, camera.width_px() - 1.0), v = rng.Uniform(0.0, camera.height_px() - 1.0);
    if (camera.Unproject({u, v}, &bearing)) return bearing;
  }
}

// Where a ray from inside meets the wall of a tube of radius 1 along z (with folds), or its end at z = `end`.
inline Eigen::Vector3d TubePoint(Rng& rng, double end) {
  const double around = rng.Uniform(0.0, 2.0 * std::numbers::pi), z = rng.Uniform(0.3, end);
  const double radius = 1.0 + 0.15 * std::sin(4.0 * z);
  return {radius * std::cos(around), radius * std::sin(around), z};
}

}  // namespace haustra::test
