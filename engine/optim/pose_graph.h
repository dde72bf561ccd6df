// Pose graph over Sim(3): keyframes as nodes, relative transforms between them as edges. Spreads the correction of a
// loop or a merge, scale drift included, over the keyframes between (Strasdat, Montiel, Davison 2010, "Scale
// drift-aware large scale monocular SLAM"). The points follow their keyframes; the caller moves them.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "engine/geometry/sim3.h"
#include "engine/optim/solve_state.h"
#include "hal/clock.h"
#include "hal/core/status.h"
#include "hal/core/time.h"

namespace haustra {

struct PoseGraphNode {
  Sim3 node_from_world;  // scale 1 before a loop is closed; after: node units per world unit
  bool is_fixed = false;
};

struct PoseGraphEdge {
  int a = 0;  // node indices, different
  int b = 0;
  Sim3 b_from_a;        // as measured
  double weight = 1.0;  // > 0, of the squared error; e.g. by the number of shared points
};

// Where a solve that was stopped goes on. Default: from the start.
struct PoseGraphProgress {
  std::vector<Sim3> nodes;  // as far as they have come; empty: at the start
  double trust_region_radius = 0.0;
  double initial_cost = 0.0;
  int iterations = 0;
};

struct PoseGraphOptions {
  int max_iterations = 30;  // >= 1
  // The translation error that counts as much as a rotation error of one radian, or a factor e in scale. 0: the mean
  // length of the edges, which makes the result independent of the map's unit.
  double translation_unit_mu = 0.0;
  std::function<bool()> should_stop;  // as in BundleOptions
  TimePoint deadline = kNoDeadline;
  const Clock* clock = nullptr;
  // For a solve in slices, in and out: begins where the last call with it was stopped, for the same edges and nodes,
  // and counts the iterations of all calls. Null: in one piece.
  PoseGraphProgress* progress = nullptr;
};

struct PoseGraphSummary {
  int iterations = 0;
  double initial_cost = 0.0;  // half the weighted sum of squared errors
  double final_cost = 0.0;
  // kPartial: stopped by `should_stop`, `deadline` or the number of iterations before the cost stopped falling.
  SolveState state = SolveState::kNone;
};

// Moves the nodes that are not fixed, when it has converged: half a correction would tear a map, so otherwise all nodes
// are as they were; with `progress` the next call goes on. When none is fixed, the first node with an edge is held for
// the call. Parts of the graph that no fixed node is connected to keep their place as well as the damping of the solver
// holds it; nodes without edges are left alone. Fixed and held nodes are unchanged to the bit.
//
// Deterministic to the bit for the same input when nothing stops it: one thread, Eigen's own factorisation, nodes in
// the order of their indices. Allocates (Ceres): never on the tracking thread. reentrant. Cost: see
// engine/optim/benchmarks/pose_graph_benchmark.cc; `should_stop` and `deadline` are asked once an iteration. Errors:
// kInvalidArgument (options; index out of range, an edge from a node to itself, weight or scale not positive, not
// finite), kInternal (the solver ran out of memory). On error the nodes are untouched.
Result<PoseGraphSummary> OptimizePoseGraphSim3(const PoseGraphOptions& options, std::span<const PoseGraphEdge> edges,
                                               std::vector<PoseGraphNode>* nodes);

}  // namespace haustra
