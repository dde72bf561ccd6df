// A scope that runs round a loop while rotation, translation and scale drift, for benchmarks and tests of the pose
// graph.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/geometry/sim3.h"
#include "engine/optim/pose_graph.h"

namespace haustra {

struct SyntheticLoopOptions {
  int num_nodes = 60;
  int neighbours = 3;         // edges from each node to as many before it
  double scale_drift = 1.01;  // factor from one node to the next
  double rotation_drift_rad = 0.004;
  double translation_drift = 0.01;  // share of a step
  std::uint64_t seed = 1;           // directions of the drift
};

struct SyntheticLoop {
  std::vector<SE3> truth;            // cam_from_world
  std::vector<PoseGraphNode> nodes;  // as the drifting scope believes; the first is fixed and right
  std::vector<PoseGraphEdge> edges;  // between neighbours, consistent with `nodes`; the last one closes the loop with
};                                   //   the true Sim(3) between the frames of the last and the first node

SyntheticLoop MakeSyntheticLoop(const SyntheticLoopOptions& options);

}  // namespace haustra
