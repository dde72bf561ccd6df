// Depth of keyframes on a CUDA device (hal/depth_solver.h). A stream of the lowest priority, whose kernels are short,
// so that the work for frames goes first. Compute capability 7.0 and up.
#pragma once

#include <memory>

#include "hal/core/memory_plan.h"
#include "hal/core/status.h"
#include "hal/depth_solver.h"

namespace haustra {

// What a solver takes; needs no device. Of the plan its sizes alone are looked at.
MemoryPlan PlanCudaDepthSolver(const DepthSolverPlan& plan);

// Takes all its memory. On the device 5 max_sources + 2 bytes a pixel, and a cell 89 bytes and 8 a sample of its
// window; pinned on the host max_sources + 1 bytes a pixel and 21 a cell. kUnavailable: no device. kInvalidArgument:
// the plan. kCapacityExceeded: memory.
Result<std::unique_ptr<DepthSolver>> CreateCudaDepthSolver(const DepthSolverPlan& plan, int device = 0);

}  // namespace haustra
