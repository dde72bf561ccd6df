// The exported model of a map (maps/map_NNNN/, COLMAP text): its points, and what its keyframes see of them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "engine/geometry/se3.h"
#include "hal/core/status.h"
#include "tools/evaluate/run_output.h"

namespace haustra::report {

struct MapModel {
  struct Keyframe {
    std::string image_name;
    std::map<std::int64_t, Eigen::Vector2d> pixels;  // by point id; pixel centres at integers
    SE3 cam_from_map{};                              // map units
  };
  std::vector<Eigen::Vector3d> points;           // in the map, map units
  std::vector<std::array<std::uint8_t, 3>> rgb;  // one a point
  std::vector<std::int64_t> point_ids;           // one a point
  std::map<std::int64_t, Keyframe> keyframes;    // by keyframe id
};

// kNotFound, kUnavailable: a file; kInvalidArgument with file and line: not what it should be.
Result<MapModel> ReadMapModel(const std::string& folder);

// Those of all maps that a run has exported, by map id. Errors of ReadMapModel; kNotFound: the folder of the maps is
// gone.
Result<std::map<int, MapModel>> ReadMapModels(const evaluate::RunOutput& run);

// What tells the map of this run from that of another one: eight hexadecimal digits, of keyframes and their poses.
std::string ChecksumOfPoses(const MapModel& model);

}  // namespace haustra::report
