// What all readers of an exported map (COLMAP text, engine/io/colmap_writer.h) hold to. reentrant.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <span>

#include "engine/geometry/se3.h"

namespace haustra::evaluate {

inline constexpr double kColmapPixelOrigin = 0.5;       // its coordinate of the centre of the first pixel
inline constexpr std::int64_t kFirstColmapImageId = 1;  // of keyframe 0

// Of an image: qw qx qy qz, x y z. Nothing: the first four are no rotation, not even a badly rounded one.
inline std::optional<SE3> ColmapPose(std::span<const double, 7> pose) {
  const Eigen::Quaterniond rotation(pose[0], pose[1], pose[2], pose[3]);
  if (!(std::abs(rotation.norm() - 1.0) < 0.5)) return std::nullopt;
  return SE3(rotation, Eigen::Vector3d(pose[4], pose[5], pose[6]));
}

}  // namespace haustra::evaluate
