// Time of the pose graph over loops of the size of a region (200 keyframes) and of a whole procedure (1200).
#include <benchmark/benchmark.h>

#include "engine/optim/benchmarks/synthetic_loop.h"
#include "engine/optim/pose_graph.h"

namespace haustra {
namespace {

void CloseLoop(benchmark::State& state) {
  const SyntheticLoop loop =
      MakeSyntheticLoop({.num_nodes = static_cast<int>(state.range(0)), .neighbours = 5, .scale_drift = 1.001});
  PoseGraphSummary summary;
  for (auto _ : state) {
    std::vector<PoseGraphNode> nodes = loop.nodes;
    summary = OptimizePoseGraphSim3(PoseGraphOptions(), loop.edges, &nodes).value();
  }
  state.counters["edges"] = static_cast<double>(loop.edges.size());
  state.counters["iterations"] = summary.iterations;
  state.counters["final_cost"] = summary.final_cost;
}
BENCHMARK(CloseLoop)->Arg(200)->Arg(1200)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace haustra

BENCHMARK_MAIN();
