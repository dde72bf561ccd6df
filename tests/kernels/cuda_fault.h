// Breaks the CUDA context of this process as the loss of a device does: every call of CUDA fails from then on, and only
// another process can use the device. It costs the device nothing.
#pragma once

#include <cstdint>

#include "hal/core/status.h"

namespace haustra::testing {

enum class CudaFault {
  kTrap,            // a kernel stops itself
  kIllegalAddress,  // a kernel writes where nothing is
};

// Queues, on a stream of its own, kernels that keep all processors of the current device busy for `busy_ms` and do the
// fault then: what is queued after this is not done before. Does not wait. kUnavailable: it cannot be queued.
Status QueueCudaFault(CudaFault fault, std::int64_t busy_ms);

}  // namespace haustra::testing
