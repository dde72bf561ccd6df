// Guided matching: a warp to a query, lanes over all keypoints of the set. Going through all of them costs less than an
// index would (a few thousand, against launches of microseconds).
#include <cstdint>

#include "kernels/cuda/match_common.cuh"
#include "kernels/cuda/match_kernels.h"

namespace haustra::kernels::cuda {
namespace {

constexpr int kWarps = 4;

__device__ __forceinline__ void MatchQuery(const GuidedJob& job, const SetBuffers& sets, int index) {
  __shared__ uint4 descriptors[kWarps][kDescriptorBytes / 16];
  const int lane = threadIdx.x % 32;
  const int warp = threadIdx.x / 32;
  const GuidedRow query = job.queries[index];
  TwoNearest top;
  // Negated so that NaN finds nothing.
  const bool is_usable = query.row >= 0 && query.radius_px >= 0.0f && isfinite(query.x_px) && isfinite(query.y_px);
  if (is_usable) {
    const uint4* of_query =
        reinterpret_cast<const uint4*>(sets.descriptors + static_cast<std::size_t>(query.row) * kDescriptorBytes);
    if (lane < kDescriptorBytes / 16) descriptors[warp][lane] = of_query[lane];
    __syncwarp();
    const float inverse_norm = sets.inverse_norms[query.row];
    const float squared_radius = __fmul_rn(query.radius_px, query.radius_px);
    for (int i = lane; i < job.num_train; i += 32) {
      const std::int32_t row = job.train_row + i;
      const Keypoint* keypoint = sets.keypoints + row;
      const float dx = __fsub_rn(keypoint->x_px, query.x_px);
      const float dy = __fsub_rn(keypoint->y_px, query.y_px);
      if (!(__fadd_rn(__fmul_rn(dx, dx), __fmul_rn(dy, dy)) <= squared_radius)) continue;
      if (!(keypoint->scale_px >= query.min_scale_px && keypoint->scale_px <= query.max_scale_px)) continue;
      if (job.train_allowed != nullptr && job.train_allowed[i] == 0) continue;
      const uint4* of_train =
          reinterpret_cast<const uint4*>(sets.descriptors + static_cast<std::size_t>(row) * kDescriptorBytes);
      std::uint32_t product = 0;
#pragma unroll
      for (int k = 0; k < kDescriptorBytes / 16; ++k) {
        const uint4 a = descriptors[warp][k];
        const uint4 b = of_train[k];
        product = __dp4a(a.x, b.x, product);
        product = __dp4a(a.y, b.y, product);
        product = __dp4a(a.z, b.z, product);
        product = __dp4a(a.w, b.w, product);
      }
      const float similarity = __fmul_rn(static_cast<float>(product), __fmul_rn(inverse_norm, sets.inverse_norms[row]));
      Join(top, similarity, -1.0f, i);
    }
  }
#pragma unroll
  for (int step = 1; step < 32; step *= 2) {
    const float best = __shfl_xor_sync(0xffffffffu, top.best, step);
    const float second = __shfl_xor_sync(0xffffffffu, top.second, step);
    const std::int32_t best_idx = __shfl_xor_sync(0xffffffffu, top.best_idx, step);
    Join(top, best, second, best_idx);
  }
  if (lane == 0) {
    top.state = Judge(top, job.options);
    job.results[index] = top;
  }
}

__global__ void __launch_bounds__(32 * kWarps)
    GuidedKernel(const __grid_constant__ GuidedJob job, const __grid_constant__ SetBuffers sets,
                 std::int32_t* counter) {
  const int index = blockIdx.x * kWarps + threadIdx.x / 32;
  if (index < job.num_queries) MatchQuery(job, sets, index);
  Complete(job.done, counter, gridDim.x);
}

__global__ void __launch_bounds__(32 * kWarps)
    InverseNormsKernel(const __grid_constant__ SetBuffers sets, std::int32_t first_row, std::int32_t num_rows) {
  const int index = blockIdx.x * kWarps + threadIdx.x / 32;
  if (index >= num_rows) return;
  const std::size_t row = static_cast<std::size_t>(first_row) + index;
  const std::uint32_t bytes = reinterpret_cast<const std::uint32_t*>(sets.descriptors)[row * 32 + threadIdx.x % 32];
  const std::uint32_t squares = __reduce_add_sync(0xffffffffu, __dp4a(bytes, bytes, 0u));
  if (threadIdx.x % 32 == 0) {
    sets.inverse_norms[row] = squares > 0 ? __fdiv_rn(1.0f, __fsqrt_rn(static_cast<float>(squares))) : 0.0f;
  }
}

}  // namespace

cudaError_t LaunchGuided(const GuidedJob& job, const SetBuffers& sets, const MatchWork& work, cudaStream_t stream) {
  GuidedKernel<<<(job.num_queries + kWarps - 1) / kWarps, 32 * kWarps, 0, stream>>>(job, sets, work.counters);
  return cudaGetLastError();
}

cudaError_t LaunchInverseNorms(const SetBuffers& sets, std::int32_t first_row, std::int32_t num_rows,
                               cudaStream_t stream) {
  InverseNormsKernel<<<(num_rows + kWarps - 1) / kWarps, 32 * kWarps, 0, stream>>>(sets, first_row, num_rows);
  return cudaGetLastError();
}

}  // namespace haustra::kernels::cuda
