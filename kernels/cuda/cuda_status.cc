#include "kernels/cuda/cuda_status.h"

#include <string>

namespace haustra::kernels::cuda {

Status ToStatus(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return Status::Ok();
  std::string message = std::string("CUDA: ") + what + ": " + cudaGetErrorString(error);
  if (error == cudaErrorMemoryAllocation) {
    (void)cudaGetLastError();  // not sticky: the device works on
    return CapacityExceeded(std::move(message));
  }
  return Unavailable(std::move(message));
}

}  // namespace haustra::kernels::cuda
