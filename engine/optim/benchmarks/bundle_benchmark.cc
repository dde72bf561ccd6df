// Time of local bundle adjustment on windows of a synthetic colon. Prints, beside the time, the iterations made, the
// cost reached and the milliseconds an iteration.
#include <benchmark/benchmark.h>

#include "engine/optim/benchmarks/synthetic_bundle.h"
#include "engine/optim/bundle_adjustment.h"
#include "engine/optim/schur_bundle_adjustment.h"

namespace haustra {
namespace {

using Adjuster = Result<BundleSummary> (*)(const CameraModel&, const BundleOptions&, BundleProblem*);

void RunWindow(benchmark::State& state, Adjuster adjust) {
  SyntheticBundleOptions options;
  options.num_poses = static_cast<int>(state.range(0));
  options.num_points = static_cast<int>(state.range(1));
  options.num_fixed_poses = static_cast<int>(state.range(2));
  options.outlier_share = 0.03;
  const SyntheticBundle bundle = MakeSyntheticBundle(options);
  BundleProblem problem;
  BundleSummary summary;
  for (auto _ : state) {
    state.PauseTiming();
    problem = bundle.start;
    state.ResumeTiming();
    summary = adjust(bundle.camera, BundleOptions(), &problem).value();
  }
  state.counters["observations"] = static_cast<double>(problem.observations.size());
  state.counters["iterations"] = summary.iterations;
  state.counters["final_cost"] = summary.final_cost;
  state.counters["outliers"] = summary.num_outliers;
}

Result<BundleSummary> AdjustPortable(const CameraModel& camera, const BundleOptions& options, BundleProblem* problem) {
  return SchurBundleAdjuster(optim::BundleKernelsFor(optim::VectorLevel::kPortable)).Adjust(camera, options, problem);
}

// Poses, points, fixed poses: the window of the issue; the same with a ring of fixed keyframes; two views.
#define HAUSTRA_WINDOWS Args({20, 4000, 2})->Args({28, 4000, 16})->Args({2, 300, 1})->Unit(benchmark::kMillisecond)
BENCHMARK_CAPTURE(RunWindow, ceres, &AdjustBundle)->HAUSTRA_WINDOWS;
BENCHMARK_CAPTURE(RunWindow, schur, &AdjustBundleSchur)->HAUSTRA_WINDOWS;
BENCHMARK_CAPTURE(RunWindow, schur_portable, &AdjustPortable)->HAUSTRA_WINDOWS;

}  // namespace
}  // namespace haustra

BENCHMARK_MAIN();
