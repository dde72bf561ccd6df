// What the device at hand can do at most, measured: the yardstick for the shares that benchmarks print.
#pragma once

#include <cuda_runtime_api.h>

namespace haustra::kernels::cuda {

struct DeviceLimits {
  double launch_and_wait_us = 0.0;   // of an empty kernel, median
  double host_read_gb_per_s = 0.0;   // a kernel that reads pinned host memory
  double copy_gb_per_s = 0.0;        // device memory, bytes read and bytes written
  double half_tera_ops_per_s = 0.0;  // mma.sync m16n8k16, half precision into float, two operations a multiply-add
  double byte_tera_ops_per_s = 0.0;  // mma.sync m16n8k32, bytes into 32-bit integers
};

// Takes and gives back about 1 GB of device memory; about 50 ms.
cudaError_t MeasureDeviceLimits(DeviceLimits* limits);

}  // namespace haustra::kernels::cuda
