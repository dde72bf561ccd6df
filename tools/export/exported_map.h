// The maps of a run as the formats of `haustra export` need it, read from the run's output folder.
// thread-bound(caller).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "engine/geometry/se3.h"
#include "hal/core/status.h"

namespace haustra::exporting {

struct ExportedFrame {
  std::int64_t frame_idx = 0;
  std::int64_t timestamp_ns = 0;
  SE3 world_from_cam;  // in the map's frame, map units
};

struct ExportedMap {
  int map_id = 0;
  std::vector<ExportedFrame> frames;             // localised in it at the end, in time order
  std::vector<Eigen::Vector3d> points;           // map units
  std::vector<std::array<std::uint8_t, 3>> rgb;  // one a point
};

struct ExportedMaps {
  std::vector<ExportedMap> maps;      // that exist at the end with at least one localised frame, by id; one or more
  std::vector<std::string> warnings;  // of evaluate::RunOutput
};

// Errors of evaluate::ReadRunOutput and report::ReadMapModel; kNotFound: the run has no such map.
Result<ExportedMaps> ReadExportedMaps(const std::string& run);

}  // namespace haustra::exporting
