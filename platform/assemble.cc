#include "platform/assemble.h"

#include <algorithm>
#include <string>
#include <thread>

#include "kernels/cpu/cpu_vision_device.h"

namespace haustra {

Result<std::unique_ptr<VisionDevice>> CreateVisionDevice(std::string_view name, const EngineConfig& config,
                                                         const CameraCalibration& calibration, int num_threads) {
  if (name == "cpu") {
    const int threads =
        num_threads > 0 ? num_threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    return CreateCpuVisionDevice(Engine::PlanFor(config, calibration), Engine::ExtractOptionsFor(config), threads);
  }
  if (name == "cuda") return Unavailable("vision device 'cuda': this build has no CUDA support; use 'cpu'");
  return InvalidArgument("vision device '" + std::string(name) + "': unknown; use 'cpu' or 'cuda'");
}

}  // namespace haustra
