// The marks of a run, read back: what "marks" of summary.json says of them, and marks.csv. Labels are a user's text.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/core/status.h"

namespace haustra::evaluate {

// One that exists at the end.
struct RunMark {
  std::string label;
  int map_id = -1;                          // that it lies in at the end
  std::optional<Eigen::Vector3d> position;  // in that map, map units; older runs do not say it
  std::int64_t session = 0;                 // run of the atlas that it was set in
  std::int64_t frame_idx = 0;               // of that run
  bool is_of_this_run = true;
};

struct RunRefusedMark {
  std::string label;
  std::int64_t frame_idx = 0;
  std::string reason;
};

// A mark in one frame that its map was tracked in.
struct RunMarkSighting {
  std::int64_t frame_idx = 0;
  std::size_t mark = 0;  // in RunMarks::set
  std::string state;     // out_of_view, in_front, hidden, unsure
  double distance_in_depths = 0.0;
};

struct RunMarks {
  std::vector<RunMark> set;
  std::vector<RunRefusedMark> refused;
  std::vector<RunMarkSighting> sightings;  // in the file's order; of marks that are gone at the end there are none
};

// Nothing when summary.json speaks of no marks. kNotFound: a file is missing; kInvalidArgument, with the file: it is
// not what it should be.
Result<RunMarks> ReadRunMarks(const std::string& folder);

}  // namespace haustra::evaluate
