// CUDA's errors as statuses.
#pragma once

#include <cuda_runtime_api.h>

#include "hal/core/status.h"

namespace haustra::kernels::cuda {

// Ok for cudaSuccess. Out of memory: kCapacityExceeded. Everything else means that the device is not there, or gone:
// kUnavailable. The message names `what` and CUDA's words.
Status ToStatus(cudaError_t error, const char* what);

}  // namespace haustra::kernels::cuda
