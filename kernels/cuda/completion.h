// How the host learns that a request is done: the last block of its work writes a number into a word of mapped host
// memory. An event of the stream comes some 8 us later, when the kernel has ended as a whole. (Brute-force matching
// needs no word: match_kernels.h.)
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
// Adds 1 to the counter and returns what it was. What this thread wrote or saw before is visible to whoever adds later,
// and what earlier ones wrote is visible to it after. (An atomicAdd between two fences waits for memory twice.)
__device__ __forceinline__ std::int32_t CountPart(std::int32_t* counter) {
  std::int32_t before;
  asm volatile("atom.add.acq_rel.gpu.s32 %0, [%1], 1;" : "=r"(before) : "l"(counter) : "memory");
  return before;
}

// Counts the parts of a piece of work, each a block: true for the last one, for which all that the others wrote is
// visible, and which leaves the counter at 0 for the next launch. For all threads of a block, with the same result.
__device__ __forceinline__ bool IsLastPart(std::int32_t* counter, int num_parts) {
  __shared__ bool is_last;
  // The threads' writes come before the barrier, so the one that counts has seen them.
  __syncthreads();
  if (threadIdx.x == 0) {
    is_last = CountPart(counter) == num_parts - 1;
    if (is_last) *counter = 0;
  }
  __syncthreads();
  return is_last;
}

// By all threads of a block that has written its part of the results: the last one of many blocks tells the host. Only
// its write of the word is ordered for the host; by then it has seen the results of all others.
__device__ __forceinline__ void Complete(const Completion& completion, std::int32_t* counter, int num_blocks) {
  __syncthreads();
  if (threadIdx.x != 0 || CountPart(counter) != num_blocks - 1) return;
  *counter = 0;
  asm volatile("st.release.sys.u32 [%0], %1;" ::"l"(&completion.word->number), "r"(completion.number) : "memory");
}
#endif

}  // namespace haustra::kernels::cuda
