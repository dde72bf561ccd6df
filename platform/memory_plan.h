// The whole memory plan of a run: engine, vision device, session. Made from the configuration alone; nothing
// is taken.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "engine/config.h"
#include "hal/camera_calibration.h"
#include "hal/core/memory_plan.h"

namespace haustra {

// `device` as in CreateVisionDevice, and planned without one: "cuda" needs a build with CUDA (else kUnavailable), no
// GPU. num_threads: of the CPU device, 0 means one for each core. Not in the plan: what libraries take of their own
// accord (CUDA driver, image readers), the lists of results that `run` keeps until it writes them, stacks and code.
Result<MemoryPlan> PlanMemory(const EngineConfig& config, const CameraCalibration& calibration, std::string_view device,
                              int num_threads);

// How much memory there is for a process, and what says so.
struct HostMemory {
  std::uint64_t bytes = 0;  // 0: not known
  std::string limit;        // "this machine's available memory"
  bool is_set = false;      // by somebody, so that no wait makes it more
};

// Whether the plan fits memory.max_host_mb and memory.max_device_mb, and what this process may have. The message names
// the line that does not fit and the limit. kCapacityExceeded: somebody set that; kUnavailable: there may be more
// later.
Status CheckMemory(const MemoryPlan& plan, const EngineConfig& config, const HostMemory& available);

// The smallest of what /proc/meminfo has available and the limits of the process's control group and those above it,
// which kill it (MemoryMax= of a unit, a container's limit).
HostMemory AvailableHostMemory();

// The smallest limit of a control group in bytes, 0: none. `groups` is what /proc/self/cgroup says, `mount` where the
// groups lie (/sys/fs/cgroup); groups of both versions are looked at.
std::uint64_t MemoryLimitOfGroups(const std::string& groups, const std::string& mount);

}  // namespace haustra
