#include "platform/assemble.h"

#include <algorithm>
#include <string>
#include <thread>

#include "kernels/cpu/cpu_vision_device.h"
#ifdef HAUSTRA_HAVE_CUDA
#include "kernels/cuda/cuda_depth_solver.h"
#include "kernels/cuda/cuda_vision_device.h"
#endif

namespace haustra {
namespace {

// That this process may use.
int NumProcessors() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

#ifdef HAUSTRA_HAVE_CUDA
Status CudaError(const Status& status) {
  return Status(status.code(), "vision device 'cuda': " + status.message() + "; use 'cpu'");
}
#else
Status NoCudaInBuild() { return Unavailable("vision device 'cuda': this build has no CUDA support; use 'cpu'"); }
#endif
Status UnknownDevice(std::string_view name) {
  return InvalidArgument("vision device '" + std::string(name) + "': unknown; use 'cpu' or 'cuda'");
}

}  // namespace

void PrepareVisionDevices() {
#ifdef HAUSTRA_HAVE_CUDA
  LoadCudaKernelsEagerly();
#endif
}

std::string_view ResolveVisionDevice(std::string_view name) {
  if (name != "auto") return name;
#ifdef HAUSTRA_HAVE_CUDA
  if (HasCudaDevice()) return "cuda";
#endif
  return "cpu";
}

int NumVisionThreads(int asked, const EngineConfig& config, Engine::Mode mode) {
  return NumVisionThreads(asked, config, mode, NumProcessors());
}

int MaxVisionThreads() { return kMaxCpuVisionThreads; }

int NumVisionThreads(int asked, const EngineConfig& config, Engine::Mode mode, int num_processors) {
  const bool leaves_one = mode == Engine::Mode::kRealTime && config.rt.enabled;
  const int num_free = leaves_one ? num_processors - 1 : num_processors;
  return std::clamp(asked > 0 ? asked : num_free, 1, kMaxCpuVisionThreads);
}

Result<std::unique_ptr<VisionDevice>> CreateVisionDevice(std::string_view name, const EngineConfig& config,
                                                         const CameraCalibration& calibration, int num_threads) {
  return CreateVisionDevice(name, Engine::PlanFor(config, calibration), Engine::ExtractOptionsFor(config), num_threads);
}

Result<std::unique_ptr<VisionDevice>> CreateVisionDevice(std::string_view name, const VisionPlan& plan,
                                                         const ExtractOptions& options, int num_threads) {
  if (name == "cpu") {
    return CreateCpuVisionDevice(plan, options,
                                 num_threads > 0 ? num_threads : std::min(NumProcessors(), kMaxCpuVisionThreads));
  }
  if (name == "cuda") {
#ifdef HAUSTRA_HAVE_CUDA
    Result<std::unique_ptr<CudaVisionDevice>> device = CreateCudaVisionDevice(plan, options);
    if (device.ok()) return std::unique_ptr<VisionDevice>(std::move(device).value());
    return CudaError(device.status());
#else
    return NoCudaInBuild();
#endif
  }
  return UnknownDevice(name);
}

Result<std::unique_ptr<DepthSolver>> CreateDepthSolver(std::string_view name, const DepthSolverPlan& plan) {
  if (name == "cpu") return std::unique_ptr<DepthSolver>();
  if (name != "cuda") return UnknownDevice(name);
#ifdef HAUSTRA_HAVE_CUDA
  Result<std::unique_ptr<DepthSolver>> solver = CreateCudaDepthSolver(plan);
  if (!solver.ok()) return CudaError(solver.status());
  return solver;
#else
  (void)plan;
  return NoCudaInBuild();
#endif
}

Result<DepthSearch> CreateDepthSearch(std::string_view name, const EngineConfig& config, const CameraModel& camera,
                                      ImageView mask) {
  DepthSearch search;
  if (!config.depth.enabled) return search;
  search.matcher = std::make_unique<DepthMatcher>(camera, mask, config.depth.options());
  HAUSTRA_ASSIGN(search.solver, CreateDepthSolver(name, search.matcher->solver_plan()));
  if (search.solver) search.matcher->SearchOn(search.solver.get());
  return search;
}

}  // namespace haustra
