// Launches of kernels that follow one another closely.
#pragma once

#include <cuda_runtime.h>

namespace haustra::kernels::cuda {

// Launches a kernel that begins with WaitForKernelBefore, or needs nothing of the kernel before on the stream. `early`:
// its blocks may be placed while that one still runs (compute capability 9 and up), which saves the time between the
// two.
template <typename... Parameters, typename... Arguments>
cudaError_t LaunchAfter(bool early, void (*kernel)(Parameters...), dim3 grid, int num_threads, int shared_bytes,
                        cudaStream_t stream, const Arguments&... arguments) {
  cudaLaunchAttribute attribute{};
  attribute.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  attribute.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = grid;
  config.blockDim = dim3(num_threads);
  config.dynamicSmemBytes = shared_bytes;
  config.stream = stream;
  config.attrs = &attribute;
  config.numAttrs = early ? 1 : 0;
  return cudaLaunchKernelEx(&config, kernel, static_cast<Parameters>(arguments)...);
}

// From here on blocks of the kernel after may be placed.
__device__ __forceinline__ void LetKernelAfterBegin() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;" ::: "memory");
#endif
}

// Nothing that the kernel before writes may be touched earlier.
__device__ __forceinline__ void WaitForKernelBefore() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
  LetKernelAfterBegin();
}

}  // namespace haustra::kernels::cuda
