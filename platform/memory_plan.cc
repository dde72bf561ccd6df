#include "platform/memory_plan.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>
#include <thread>

#include "engine/engine.h"
#include "kernels/cpu/cpu_vision_device.h"

namespace haustra {
namespace {

// Frames on their way from capture to tracking (platform/session/realtime_session.cc), in colour.
constexpr std::uint64_t kFramesInFlight = 3;
constexpr std::uint64_t kBytesPerPixelInFlight = 3;

}  // namespace

Result<MemoryPlan> PlanMemory(const EngineConfig& config, const CameraCalibration& calibration, std::string_view device,
                              int num_threads) {
  MemoryPlan plan = Engine::PlanMemory(config);
  const VisionPlan vision = Engine::PlanFor(config, calibration);
  if (device == "cpu") {
    const int threads =
        num_threads > 0 ? num_threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    plan.Append(PlanCpuVisionDevice(vision, Engine::ExtractOptionsFor(config), threads));
  } else if (device == "cuda") {
    // The sets alone; see PlanMemory about the rest.
    const auto num_sets = static_cast<std::uint64_t>(vision.max_feature_sets);
    plan.Add(MemoryPlace::kDevice, "feature sets (cuda)", num_sets,
             num_sets * static_cast<std::uint64_t>(vision.max_features) *
                 (kDescriptorBytes + sizeof(Keypoint) + sizeof(float)),
             "memory.max_keyframes x features.max");
  } else {
    return InvalidArgument("vision device '" + std::string(device) + "': unknown; use 'cpu' or 'cuda'");
  }
  plan.Add(MemoryPlace::kHost, "frames in flight", kFramesInFlight,
           kFramesInFlight * kBytesPerPixelInFlight * static_cast<std::uint64_t>(calibration.width_px) *
               static_cast<std::uint64_t>(calibration.height_px),
           "image size; real-time mode");
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
