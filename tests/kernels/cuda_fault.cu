// One thread does the fault; all others, as many as the device holds and more, wait for the time to come. Nothing in
// and out, no shared memory, 1024 threads so that two blocks fill a processor.
#include "tests/kernels/cuda_fault.h"

#include <cuda_runtime.h>

#include <string>

namespace haustra::testing {
namespace {

constexpr int kThreads = 1024;
constexpr int kBlocksPerProcessor = 4;
constexpr int kOthersLonger = 4;  // they leave no room before the fault

__global__ void FaultKernel(CudaFault fault, std::int64_t busy_ns) {
  const bool is_first = blockIdx.x == 0 && threadIdx.x == 0;
  std::int64_t begin = 0;
  std::int64_t now = 0;
  asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(begin));
  do {
    asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(now));
  } while (now - begin < (is_first ? busy_ns : kOthersLonger * busy_ns));
  if (!is_first) return;
  if (fault == CudaFault::kTrap) __trap();
  *reinterpret_cast<volatile int*>(std::uintptr_t{64}) = 1;
}

}  // namespace

Status QueueCudaFault(CudaFault fault, std::int64_t busy_ms) {
  int device = 0;
  int num_processors = 0;
  cudaStream_t stream = nullptr;  // nobody can give it back after the fault
  cudaError_t error = cudaGetDevice(&device);
  if (error == cudaSuccess) {
    error = cudaDeviceGetAttribute(&num_processors, cudaDevAttrMultiProcessorCount, device);
  }
  if (error == cudaSuccess) error = cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking);
  if (error == cudaSuccess) {
    FaultKernel<<<kBlocksPerProcessor * num_processors, kThreads, 0, stream>>>(fault, busy_ms * 1'000'000);
    error = cudaGetLastError();
  }
  if (error == cudaSuccess) return Status::Ok();
  return Unavailable(std::string("fault of the device: ") + cudaGetErrorString(error));
}

}  // namespace haustra::testing
