#include "platform/memory_plan.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>
#include <sstream>
#include <string>
#include <thread>

#include "engine/engine.h"
#include "kernels/cpu/cpu_vision_device.h"
#ifdef HAUSTRA_HAVE_CUDA
#include "kernels/cuda/cuda_depth_solver.h"
#include "kernels/cuda/cuda_vision_device.h"
#endif
#include "platform/session/session.h"

namespace haustra {
namespace {

// MemAvailable of /proc/meminfo; 0 when it cannot be read.
std::uint64_t MachineBytes() {
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

}  // namespace

Result<MemoryPlan> PlanMemory(const EngineConfig& config, const CameraCalibration& calibration, std::string_view device,
                              int num_threads) {
  MemoryPlan plan = Engine::PlanMemory(config, calibration.width_px, calibration.height_px);
  const VisionPlan vision = Engine::PlanFor(config, calibration);
  if (device == "cpu") {
    const int num_processors = static_cast<int>(std::thread::hardware_concurrency());
    const int threads = num_threads > 0 ? num_threads : std::clamp(num_processors, 1, kMaxCpuVisionThreads);
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
  if (config.depth.enabled) {
    const DepthOptions options = config.depth.options();
    HAUSTRA_ASSIGN([[maybe_unused]] const CameraModel camera, CameraModel::Create(calibration));
    plan.Add(MemoryPlace::kHost, "depth matcher", 1,
             DepthMatcher::BytesFor(calibration.width_px, calibration.height_px, options), "image size, depth.step_px");
#ifdef HAUSTRA_HAVE_CUDA
    if (device == "cuda") plan.Append(PlanCudaDepthSolver(DepthMatcher::SolverSizes(camera, options)));
#endif
  }
  plan.Append(PlanRealTimeSession(calibration));
  return plan;
}

Status CheckMemory(const MemoryPlan& plan, const EngineConfig& config, const HostMemory& available) {
  HAUSTRA_TRY(CheckFits(
      plan, {config.memory.max_host_mb, config.memory.max_device_mb, "memory.max_host_mb", "memory.max_device_mb"}));
  Status fits = CheckFits(plan, {static_cast<double>(available.bytes) / 1e6, 0.0, available.limit, ""});
  return fits.ok() || available.is_set ? fits : Unavailable(fits.message());
}

HostMemory AvailableHostMemory() {
  const HostMemory machine{MachineBytes(), "this machine's available memory", false};
  std::ifstream file("/proc/self/cgroup");
  const std::string groups((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const HostMemory group{MemoryLimitOfGroups(groups, "/sys/fs/cgroup"), "the memory limit of the control group", true};
  const bool is_group_less = group.bytes > 0 && (machine.bytes == 0 || group.bytes < machine.bytes);
  return is_group_less ? group : machine;
}

std::uint64_t MemoryLimitOfGroups(const std::string& groups, const std::string& mount) {
  std::uint64_t least = 0;
  std::istringstream lines(groups);
  for (std::string line; std::getline(lines, line);) {
    // "0::/system.slice/haustrad.service" of the second version, "4:memory:/..." of the first.
    const std::size_t first = line.find(':');
    const std::size_t second = first == std::string::npos ? first : line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const bool is_second_version = controllers.empty();
    if (!is_second_version && controllers != "memory") continue;
    const std::string root = is_second_version ? mount : mount + "/memory";
    const std::string name = is_second_version ? "/memory.max" : "/memory.limit_in_bytes";
    // A group may lie above what this process sees of the tree; then its folder is not there.
    for (std::string group = line.substr(second + 1);; group.resize(group.rfind('/'))) {
      std::uint64_t bytes = 0;  // the file says "max" where there is none
      std::string path = root;
      path.append(group).append(name);
      if (std::ifstream file(path); file >> bytes && bytes > 0 && (least == 0 || bytes < least)) {
        least = bytes;
      }
      if (group.find('/') == std::string::npos) break;
    }
  }
  return least;
}

}  // namespace haustra
