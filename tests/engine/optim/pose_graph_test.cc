#include "engine/optim/pose_graph.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "engine/geometry/rng.h"
#include "engine/optim/benchmarks/synthetic_loop.h"

namespace haustra {
namespace {

Eigen::Vector3d Centre(const PoseGraphNode& node) { return node.node_from_world.Inverse().translation; }

double MaxCentreError(const std::vector<PoseGraphNode>& nodes, const std::vector<SE3>& truth) {
  double error = 0.0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    error = std::max(error, (Centre(nodes[i]) - truth[i].InverseTranslation()).norm());
  }
  return error;
}

double MaxRotationError(const std::vector<PoseGraphNode>& nodes, const std::vector<SE3>& truth) {
  double error = 0.0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    error = std::max(error, RotationAngle(nodes[i].node_from_world.rotation, truth[i].rotation));
  }
  return error;
}

bool IsSame(const Sim3& a, const Sim3& b) {
  return a.scale == b.scale && a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

bool IsSame(const std::vector<PoseGraphNode>& a, const std::vector<PoseGraphNode>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!IsSame(a[i].node_from_world, b[i].node_from_world)) return false;
  }
  return a.size() == b.size();
}

TEST(PoseGraph, PureScaleDriftIsUndone) {
  const SyntheticLoop loop =
      MakeSyntheticLoop({.scale_drift = 1.01, .rotation_drift_rad = 0.0, .translation_drift = 0.0});
  std::vector<PoseGraphNode> nodes = loop.nodes;

  const Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &nodes);

  ASSERT_TRUE(summary.ok()) << summary.status().ToString();
  EXPECT_EQ(summary->state, SolveState::kConverged);
  EXPECT_LT(summary->final_cost, 0.02 * summary->initial_cost);
  EXPECT_GT(MaxCentreError(loop.nodes, loop.truth), 4.0);
  EXPECT_LT(MaxCentreError(nodes, loop.truth), 0.15 * MaxCentreError(loop.nodes, loop.truth));
  // The unit at the end of the loop, which grew by 1.01^59.
  EXPECT_NEAR(std::log(nodes.back().node_from_world.scale), 59 * std::log(1.01), 0.03);
}

TEST(PoseGraph, DriftOfEveryKindShrinks) {
  const SyntheticLoop loop = MakeSyntheticLoop({.num_nodes = 90});
  std::vector<PoseGraphNode> nodes = loop.nodes;

  const Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &nodes);

  ASSERT_TRUE(summary.ok());
  EXPECT_LT(MaxCentreError(nodes, loop.truth), 0.1 * MaxCentreError(loop.nodes, loop.truth));
  // The loop says where its end is; in the middle, rotation pays a little for the drift of scale.
  const auto end_error = [&](const std::vector<PoseGraphNode>& n) {
    return RotationAngle(n.back().node_from_world.rotation, loop.truth.back().rotation);
  };
  EXPECT_LT(end_error(nodes), 0.1 * end_error(loop.nodes));
}

TEST(PoseGraph, ConsistentEdgesGiveTheTruthFromANoisyStart) {
  SyntheticLoop loop = MakeSyntheticLoop({.scale_drift = 1.0, .rotation_drift_rad = 0.0, .translation_drift = 0.0});
  Rng rng(3);
  for (std::size_t i = 1; i < loop.nodes.size(); ++i) {
    const auto noise = [&rng](double size) { return size * rng.Uniform(-1, 1); };
    const Eigen::Vector3d phi(noise(0.2), noise(0.2), noise(0.2));
    const Eigen::Vector3d rho(noise(0.5), noise(0.5), noise(0.5));
    loop.nodes[i].node_from_world = Sim3(std::exp(noise(0.2)), ExpSO3(phi), rho) * loop.nodes[i].node_from_world;
  }
  std::vector<PoseGraphNode> nodes = loop.nodes;
  PoseGraphOptions options;
  options.max_iterations = 100;

  const Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(options, loop.edges, &nodes);

  ASSERT_TRUE(summary.ok());
  EXPECT_LT(summary->final_cost, 1e-8);
  EXPECT_LT(MaxCentreError(nodes, loop.truth), 1e-3);
  EXPECT_LT(MaxRotationError(nodes, loop.truth), 1e-4);
}

TEST(PoseGraph, ResultDoesNotDependOnTheUnitOfTheMap) {
  const SyntheticLoop loop = MakeSyntheticLoop({});
  std::vector<PoseGraphNode> nodes = loop.nodes;
  ASSERT_TRUE(OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &nodes).ok());
  // The same map in a unit a thousand times smaller.
  constexpr double kUnit = 1000.0;
  std::vector<PoseGraphNode> scaled = loop.nodes;
  for (PoseGraphNode& node : scaled) node.node_from_world.translation *= kUnit;
  std::vector<PoseGraphEdge> edges = loop.edges;
  for (PoseGraphEdge& edge : edges) edge.b_from_a.translation *= kUnit;

  ASSERT_TRUE(OptimizePoseGraphSim3(PoseGraphOptions(), edges, &scaled).ok());

  for (std::size_t i = 0; i < nodes.size(); ++i) {
    EXPECT_LT((Centre(scaled[i]) / kUnit - Centre(nodes[i])).norm(), 1e-2) << i;
  }
}

TEST(PoseGraph, FixedAndLonelyNodesStayToTheBit) {
  SyntheticLoop loop = MakeSyntheticLoop({});
  loop.nodes[20].is_fixed = true;
  loop.nodes.push_back({.node_from_world = Sim3(2.0, ExpSO3({0.1, 0.2, 0.3}), {1, 2, 3})});
  std::vector<PoseGraphNode> nodes = loop.nodes;

  ASSERT_TRUE(OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &nodes).ok());

  EXPECT_TRUE(IsSame(nodes[0].node_from_world, loop.nodes[0].node_from_world));
  EXPECT_TRUE(IsSame(nodes[20].node_from_world, loop.nodes[20].node_from_world));
  EXPECT_TRUE(IsSame(nodes.back().node_from_world, loop.nodes.back().node_from_world));
  EXPECT_FALSE(IsSame(nodes[30].node_from_world, loop.nodes[30].node_from_world));
}

TEST(PoseGraph, WithoutFixedNodeTheFirstWithAnEdgeIsHeld) {
  SyntheticLoop loop = MakeSyntheticLoop({});
  loop.nodes[0].is_fixed = false;
  std::vector<PoseGraphNode> nodes = loop.nodes;

  ASSERT_TRUE(OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &nodes).ok());

  EXPECT_TRUE(IsSame(nodes[0].node_from_world, loop.nodes[0].node_from_world));
  EXPECT_LT(MaxCentreError(nodes, loop.truth), 0.2 * MaxCentreError(loop.nodes, loop.truth));
}

TEST(PoseGraph, HeavyEdgeWinsOverLightOne) {
  const Sim3 short_step(1.0, Eigen::Quaterniond::Identity(), {1, 0, 0});
  const Sim3 long_step(1.0, Eigen::Quaterniond::Identity(), {2, 0, 0});
  std::vector<PoseGraphNode> nodes = {{.node_from_world = Sim3(), .is_fixed = true}, {.node_from_world = Sim3()}};
  const std::vector<PoseGraphEdge> edges = {{.a = 0, .b = 1, .b_from_a = short_step, .weight = 3.0},
                                            {.a = 0, .b = 1, .b_from_a = long_step, .weight = 1.0}};
  PoseGraphOptions options;
  options.max_iterations = 100;

  ASSERT_TRUE(OptimizePoseGraphSim3(options, edges, &nodes).ok());

  EXPECT_NEAR(nodes[1].node_from_world.translation.x(), 1.25, 1e-3);
}

TEST(PoseGraph, SameInputGivesTheSameBits) {
  const SyntheticLoop loop = MakeSyntheticLoop({.num_nodes = 120, .neighbours = 5});
  std::vector<PoseGraphNode> first = loop.nodes;
  ASSERT_TRUE(OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &first).ok());
  for (int run = 0; run < 3; ++run) {
    std::vector<PoseGraphNode> again;
    again.reserve(500 * (run + 1));
    again = loop.nodes;
    ASSERT_TRUE(OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &again).ok());
    EXPECT_TRUE(IsSame(first, again));
  }
}

class TickingClock : public Clock {
 public:
  TimePoint Now() const override { return TimePoint(std::chrono::milliseconds(++num_looks_)); }

 private:
  mutable int num_looks_ = 0;
};

TEST(PoseGraph, StoppedByADeadlineItMovesNothing) {
  const SyntheticLoop loop = MakeSyntheticLoop({});
  std::vector<PoseGraphNode> nodes = loop.nodes;
  const TickingClock clock;
  PoseGraphOptions options;
  options.clock = &clock;
  options.deadline = TimePoint(std::chrono::milliseconds(2));

  const Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(options, loop.edges, &nodes);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kPartial);
  EXPECT_EQ(summary->iterations, 1);
  EXPECT_LE(summary->final_cost, summary->initial_cost);
  EXPECT_TRUE(IsSame(nodes, loop.nodes));
}

// Stopped after every iteration and gone on with, it comes to where it comes in one piece.
TEST(PoseGraph, GoesOnWhereItWasStopped) {
  const SyntheticLoop loop = MakeSyntheticLoop({.num_nodes = 90});
  std::vector<PoseGraphNode> whole = loop.nodes, sliced = loop.nodes;
  const Result<PoseGraphSummary> in_one = OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &whole);
  ASSERT_TRUE(in_one.ok());
  PoseGraphProgress progress;
  PoseGraphOptions options;
  options.progress = &progress;
  PoseGraphSummary summary;
  int num_slices = 0;
  while (summary.state != SolveState::kConverged && num_slices < 30) {
    ASSERT_TRUE(IsSame(sliced, loop.nodes)) << "moved before it was done";
    options.should_stop = [num_asked = 0]() mutable { return num_asked++ > 0; };
    const Result<PoseGraphSummary> slice = OptimizePoseGraphSim3(options, loop.edges, &sliced);
    ASSERT_TRUE(slice.ok());
    summary = *slice;
    ++num_slices;
    EXPECT_EQ(summary.iterations, progress.iterations);
  }
  EXPECT_GE(num_slices, 3);
  EXPECT_EQ(summary.state, SolveState::kConverged);
  EXPECT_EQ(summary.initial_cost, in_one->initial_cost);
  EXPECT_NEAR(summary.final_cost, in_one->final_cost, 0.01 * in_one->final_cost);
  EXPECT_LT(MaxCentreError(sliced, loop.truth), 1.05 * MaxCentreError(whole, loop.truth));
}

TEST(PoseGraph, OutOfIterationsItMovesNothing) {
  const SyntheticLoop loop = MakeSyntheticLoop({});
  std::vector<PoseGraphNode> nodes = loop.nodes;
  PoseGraphOptions options;
  options.max_iterations = 1;

  const Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(options, loop.edges, &nodes);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kPartial);
  EXPECT_TRUE(IsSame(nodes, loop.nodes));
}

TEST(PoseGraph, CancelledAtOnceLeavesTheNodes) {
  const SyntheticLoop loop = MakeSyntheticLoop({});
  std::vector<PoseGraphNode> nodes = loop.nodes;
  PoseGraphOptions options;
  options.should_stop = [] { return true; };

  const Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(options, loop.edges, &nodes);

  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kPartial);
  EXPECT_TRUE(IsSame(nodes, loop.nodes));
}

TEST(PoseGraph, NothingToOptimiseHasNoSolution) {
  std::vector<PoseGraphNode> nodes;
  Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(PoseGraphOptions(), {}, &nodes);
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kNone);

  nodes = {{.node_from_world = Sim3(), .is_fixed = true}, {.node_from_world = Sim3(), .is_fixed = true}};
  const std::vector<PoseGraphEdge> edges = {{.a = 0, .b = 1, .b_from_a = Sim3()}};
  summary = OptimizePoseGraphSim3(PoseGraphOptions(), edges, &nodes);
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->state, SolveState::kNone);
}

TEST(PoseGraph, BadInputIsRefusedByName) {
  const SyntheticLoop loop = MakeSyntheticLoop({.num_nodes = 10});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    const char* message;
    void (*spoil)(SyntheticLoop*, PoseGraphOptions*, double);
  };
  const Case cases[] = {
      {"edges[2] names node 10", [](SyntheticLoop* l, PoseGraphOptions*, double) { l->edges[2].b = 10; }},
      {"edges[2] names node -1", [](SyntheticLoop* l, PoseGraphOptions*, double) { l->edges[2].a = -1; }},
      {"edges[2] leads from node", [](SyntheticLoop* l, PoseGraphOptions*, double) { l->edges[2].a = l->edges[2].b; }},
      {"edges[1].weight", [](SyntheticLoop* l, PoseGraphOptions*, double) { l->edges[1].weight = 0; }},
      {"edges[1].b_from_a", [](SyntheticLoop* l, PoseGraphOptions*, double) { l->edges[1].b_from_a.scale = -1; }},
      {"nodes[4]", [](SyntheticLoop* l, PoseGraphOptions*, double v) { l->nodes[4].node_from_world.scale = v; }},
      {"max_iterations", [](SyntheticLoop*, PoseGraphOptions* o, double) { o->max_iterations = 0; }},
      {"translation_unit_mu", [](SyntheticLoop*, PoseGraphOptions* o, double v) { o->translation_unit_mu = v; }},
      {"clock", [](SyntheticLoop*, PoseGraphOptions* o, double) { o->deadline = TimePoint(Duration(1)); }},
  };
  for (const Case& c : cases) {
    SyntheticLoop spoilt = loop;
    PoseGraphOptions options;
    c.spoil(&spoilt, &options, nan);
    std::vector<PoseGraphNode> nodes = spoilt.nodes;
    const Result<PoseGraphSummary> summary = OptimizePoseGraphSim3(options, spoilt.edges, &nodes);
    ASSERT_FALSE(summary.ok()) << c.message;
    EXPECT_EQ(summary.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(summary.status().message().find(c.message), std::string::npos) << summary.status().message();
    EXPECT_TRUE(IsSame(nodes[1].node_from_world, spoilt.nodes[1].node_from_world));
  }
}

}  // namespace
}  // namespace haustra
