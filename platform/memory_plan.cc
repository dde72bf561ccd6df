#include "platform/memory_plan.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>
#include <thread>

#include "engine/engine.h"
#include "kernels/cpu/cpu_vision_device.h"
#ifdef HAUSTRA_HAVE_CUDA
#include "kernels/cuda/cuda_vision_device.h"
#endif
#include "platform/session/session.h"

namespace haustra {
Result<MemoryPlan> PlanMemory(const EngineConfig& config, const CameraCalibration& calibration, std::string_view device,
                              int num_threads) {
  MemoryPlan plan = Engine::PlanMemory(config);
  const VisionPlan vision = Engine::PlanFor(config, calibration);
  if (device == "cpu") {
    const int threads =
        num_threads > 0 ? num_threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    plan.Append(PlanCpuVisionDevice(vision, Engine::ExtractOptionsFor(config), threads));
  } else if (device == "cuda") {
#ifdef HAUSTRA_HAVE_CUDA
    HAUSTRA_ASSIGN(const MemoryPlan cuda, PlanCudaVisionDevice(vision, Engine::ExtractOptionsFor(config)));
    plan.Append(cuda);
#else
    return Unavailable("vision device 'cuda': this build has no CUDA support; use 'cpu'");
#endif
  } else {
    return InvalidArgument("vision device '" + std::string(device) + "': unknown; use 'cpu' or 'cuda'");
  }
  plan.Append(PlanRealTimeSession(calibration));
  return plan;
}

Status CheckMemory(const MemoryPlan& plan, const EngineConfig& config, std::uint64_t available_host_bytes) {
  HAUSTRA_TRY(CheckFits(
      plan, {config.memory.max_host_mb, config.memory.max_device_mb, "memory.max_host_mb", "memory.max_device_mb"}));
  return CheckFits(plan, {static_cast<double>(available_host_bytes) / 1e6, 0.0, "this machine's available memory", ""});
}

std::uint64_t AvailableHostBytes() {
  std::ifstream file("/proc/meminfo");
  for (std::string name; file >> name;) {
    if (name == "MemAvailable:") {
      std::uint64_t kilobytes = 0;
      return file >> kilobytes ? kilobytes * 1024 : 0;
    }
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return 0;
}

}  // namespace haustra
