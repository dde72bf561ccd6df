// The frames of a run with everything that the judgement of one needs.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tools/evaluate/run_output.h"
#include "tools/evaluate/trajectory_error.h"

namespace haustra::evaluate {

struct EvaluatedFrame {
  std::int64_t frame_idx = 0;
  int live_map_id = -1;
  int map_id = -1;                // at the end
  std::int64_t keyframe_id = -1;  // that it was tracked against
  bool is_clear = true;           // the scene can be seen
  std::optional<SE3> truth;       // world_from_cam
  SE3 estimated;                  // world_from_cam in the final map; when map_id >= 0
  double depth = 0.0;             // of the scene, ground-truth units; 0: not known
  bool is_recovered = false;      // its pose was found by brute force while tracking

  bool is_localised() const { return map_id >= 0; }
  PosePair pair() const { return {estimated, *truth}; }
};

// Which of the maps that were begun have become one by the merges so far. A map's frames keep the id under which they
// were answered, so a part of a merged map is a set of ids.
class MapGroups {
 public:
  void Merge(int map_id, int other_map_id);
  // All maps that this one has been merged with, itself included.
  const std::set<int>& Of(int map_id);

 private:
  std::vector<std::set<int>> groups_;
};

}  // namespace haustra::evaluate
