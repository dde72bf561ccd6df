// The whole memory plan of a run: engine, vision device, session. Made from the configuration alone; nothing
// is taken.
#pragma once

#include <cstdint>
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

// Whether the plan fits memory.max_host_mb and memory.max_device_mb, and what this machine has left
// (`available_host_bytes`, 0: not known). kCapacityExceeded names the line that does not fit.
Status CheckMemory(const MemoryPlan& plan, const EngineConfig& config, std::uint64_t available_host_bytes);

// MemAvailable of /proc/meminfo in bytes; 0 when it cannot be read.
std::uint64_t AvailableHostBytes();

}  // namespace haustra
