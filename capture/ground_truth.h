// Reference trajectories as data sets publish them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

// world_from_cam; camera axes x right, y down, z forward. Lengths in the unit of the file: mm in C3VD and in what
// haustra renders, m in EuRoC and TUM, arbitrary for structure from motion.
struct GroundTruthPose {
  std::int64_t timestamp_ns = 0;
  std::array<double, 3> position_in_world{};
  std::array<double, 4> world_from_cam_xyzw{0.0, 0.0, 0.0, 1.0};  // unit quaternion
};

// Told apart by their content:
//   TUM    8 fields between blanks: time in seconds, position, quaternion x y z w
//   EuRoC  at least 8 fields between commas: time in ns, position, quaternion w x y z. These are poses of the body;
//   that of
//          the camera comes from T_BS in cam0/sensor.yaml two folders up, which must be there
//   C3VD   16 fields between commas: camera-to-world, 4x4, column by column; line k (from 0) has the time k / 29.97 Hz,
//          which is what ListC3vd gives to k_color.png
// Poses are in time order, at least one. kNotFound, kUnavailable: a file cannot be read. kInvalidArgument: a line is
// wrong (not a number, not finite, no rotation, time not after that of the line before); the message names file and
// line. reentrant.
Result<std::vector<GroundTruthPose>> ReadGroundTruth(const std::string& path);

}  // namespace haustra
