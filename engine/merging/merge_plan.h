// What a proven common area (engine/place/common_area.h) asks the atlas to become, and what came of it. A plan names
// entities by handle only, so it may wait between recognition and application; a stale one is refused. Its similarity
// is one between two keyframes: when these have moved since, or their maps' units have changed, it goes along.
#pragma once

#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/atlas/reframing.h"
#include "engine/geometry/sim3.h"
#include "engine/optim/solve_state.h"
#include "engine/place/common_area.h"

namespace haustra {

struct MergePlan {
  KeyframeHandle keyframe_a;  // the new one, of the active map
  KeyframeHandle keyframe_b;  // of the same map: a loop; of another: a merge
  Sim3 b_from_a;              // points of the map of a to that of b; in a loop: what drift did around a, undone
  std::vector<CommonPoint> points;
  // Where the two keyframes stood when the similarity was found.
  KeyframeAnchor anchor_a;
  KeyframeAnchor anchor_b;
};

inline MergePlan MakeMergePlan(const CommonArea& area) {
  return {area.keyframe_a, area.keyframe_b, area.b_from_a, area.points, area.anchor_a, area.anchor_b};
}

struct MergeOutcome {
  bool is_loop = false;
  bool has_moved = false;    // the maps are one, or the drift is out
  bool is_reframed = false;  // the last slice has moved the map
  MapHandle map;             // from then on holds everything; its id is that of the larger one of the two
  MapId map_id = kNoId;
  MapHandle absorbed;  // the other one, empty now; invalid for a loop
  MapId absorbed_map_id = kNoId;
  // Where things at the tracked keyframe went in the last slice, for the tracker.
  Reframing reframing;
  int num_fused = 0;  // points that were one and are one now
  int num_weld_keyframes = 0;
  int num_weld_points = 0;
  int num_weld_outliers = 0;
  int weld_iterations = 0;
  double weld_initial_cost = 0.0;
  double weld_final_cost = 0.0;
  SolveState weld_state = SolveState::kNone;
  int num_graph_nodes = 0;  // 0: all keyframes were welded, none was left to follow
  int num_graph_edges = 0;
  int graph_iterations = 0;
  SolveState graph_state = SolveState::kNone;
};

}  // namespace haustra
