#include "engine/optim/benchmarks/synthetic_loop.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/geometry/rng.h"

namespace haustra {
namespace {

Eigen::Vector3d UnitCubeVector(Rng* rng) {
  const double x = rng->Uniform(-1, 1), y = rng->Uniform(-1, 1), z = rng->Uniform(-1, 1);
  return {x, y, z};
}

SE3 TruePose(int idx, int num_nodes) {
  const double angle = 2.0 * std::numbers::pi * idx / num_nodes;
  const Eigen::Vector3d centre(10.0 * std::cos(angle), 10.0 * std::sin(angle), std::sin(3.0 * angle));
  const Eigen::Quaterniond world_from_cam = ExpSO3({0, 0, angle}) * ExpSO3({0.3 * std::sin(2.0 * angle), 0.2, 0});
  return SE3(world_from_cam, centre).Inverse();
}

}  // namespace

SyntheticLoop MakeSyntheticLoop(const SyntheticLoopOptions& options) {
  SyntheticLoop loop;
  Rng rng(options.seed);
  for (int i = 0; i < options.num_nodes; ++i) loop.truth.push_back(TruePose(i, options.num_nodes));

  // A monocular scope believes in rigid motion whose length is in a unit that creeps.
  std::vector<SE3> believed = {loop.truth[0]};
  std::vector<double> unit = {1.0};  // believed length of a true length of 1
  const Eigen::Vector3d bias = options.rotation_drift_rad * UnitCubeVector(&rng);
  for (int i = 1; i < options.num_nodes; ++i) {
    SE3 step = loop.truth[i] * loop.truth[i - 1].Inverse();
    const double step_length = step.translation.norm();
    step.rotation = step.rotation * ExpSO3(bias);
    step.translation += options.translation_drift * step_length * UnitCubeVector(&rng);
    unit.push_back(unit.back() * options.scale_drift);
    step.translation *= unit.back();
    believed.push_back(step * believed.back());
  }
  for (int i = 0; i < options.num_nodes; ++i) {
    loop.nodes.push_back({.node_from_world = Sim3(believed[i]), .is_fixed = i == 0});
    for (int j = std::max(0, i - options.neighbours); j < i; ++j) {
      loop.edges.push_back({.a = j, .b = i, .b_from_a = Sim3(believed[i] * believed[j].Inverse()), .weight = 1.0});
    }
  }
  // The same points seen from both ends: the last camera measures them in its unit.
  const int last = options.num_nodes - 1;
  Sim3 first_from_last(loop.truth[0] * loop.truth[last].Inverse());
  first_from_last = first_from_last * Sim3(1.0 / unit[last], Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  loop.edges.push_back({.a = last, .b = 0, .b_from_a = first_from_last, .weight = 10.0});
  return loop;
}

}  // namespace haustra
