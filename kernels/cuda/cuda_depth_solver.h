// Depth of keyframes on a CUDA device (hal/depth_solver.h). A stream of the lowest priority, whose kernels are short,
// so that the work for frames goes first. Compute capability 7.0 and up.
#pragma once

#include <memory>

#include "hal/core/status.h"
#include "hal/depth_solver.h"

namespace haustra {

// Takes all its memory, pinned and on the device: about 6 bytes a pixel and 440 bytes a cell with the windows of the
// default options, for max_sources + 1 pictures. kUnavailable: no device. kInvalidArgument: the plan.
// kCapacityExceeded: memory.
Result<std::unique_ptr<DepthSolver>> CreateCudaDepthSolver(const DepthSolverPlan& plan, int device = 0);

}  // namespace haustra
