// How the host learns that a request is done: the last block of its work writes a number into a word of mapped host
// memory. An event of the stream comes some 8 us later, when the kernel has ended as a whole.
#pragma once

#include <cstdint>

namespace haustra::kernels::cuda {

// A cache line of its own: the host looks at it without pause.
struct alignas(64) DoneWord {
  std::uint32_t number = 0;
};

struct Completion {
  DoneWord* word = nullptr;  // as the device sees it
  std::uint32_t number = 0;
};

#ifdef __CUDACC__
// Counts the parts of a piece of work, each a block: true for the last one, for which all that the others wrote is
// visible, and which leaves the counter at 0. For all threads of a block, with the same result.
__device__ __forceinline__ bool IsLastPart(std::int32_t* counter, int num_parts) {
  __shared__ bool is_last;
  // The threads' writes come before the barrier, and a fence of one thread covers what it has seen.
  __syncthreads();
  if (threadIdx.x == 0) {
    __threadfence();
    is_last = atomicAdd(counter, 1) == num_parts - 1;
    if (is_last) {
      *counter = 0;
      __threadfence();
    }
  }
  __syncthreads();
  return is_last;
}

// The same for the last step of a request, whose results are in host memory: the last part tells the host. A counter is
// nullptr where there is one part only.
__device__ __forceinline__ void Complete(const Completion& completion, std::int32_t* counter, int num_parts) {
  __syncthreads();
  if (threadIdx.x != 0) return;
  __threadfence_system();
  if (counter != nullptr) {
    if (atomicAdd(counter, 1) != num_parts - 1) return;
    *counter = 0;
    __threadfence_system();
  }
  *reinterpret_cast<volatile std::uint32_t*>(&completion.word->number) = completion.number;
}
#endif

}  // namespace haustra::kernels::cuda
