// The vision device on the CPU: the reference for the accelerators, and what runs where there is none.
//
// Work is done inside Wait, by the calling thread with the help of the device's own, and stops at the deadline; the
// next Wait goes on from there. Enqueue* does only what the lane owes of the request before. Each lane has its own
// workspace and its own helpers, so the lanes never wait for one another.
#pragma once

#include <memory>

#include "hal/core/memory_plan.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"
#include "kernels/cpu/simd_level.h"

namespace haustra {

inline constexpr int kMaxCpuVisionThreads = 64;

// num_threads counts the calling thread, [1, kMaxCpuVisionThreads]; each lane has so many less one of its own. Takes
// all memory: per lane about 110 bytes a pixel of the plan's image (only the tracking lane's is touched before it is
// used), per feature set about 160 bytes a feature. kInvalidArgument: plan or options out of range (the message names
// the field); kCapacityExceeded: not enough memory, or too few threads.
Result<std::unique_ptr<VisionDevice>> CreateCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                            int num_threads);

// What the device will take, all of it on the host.
MemoryPlan PlanCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options, int num_threads);

// The same with a given instruction set, for tests and measurements. kUnavailable: this processor does not have it.
Result<std::unique_ptr<VisionDevice>> CreateCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                            int num_threads, kernels::SimdLevel level);

}  // namespace haustra
