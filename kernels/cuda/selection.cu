// Which points become features: the rule of kernels/cpu/feature_selection.h without its sorts. Every rank is the number
// of points that go before, so the results do not depend on the order in which the points were found.
#include <cstdint>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kCellThreads = 512;
constexpr int kSurvivorThreads = 512;
constexpr int kSurvivorBlocks = 64;
constexpr int kBinsPerThread = kPriorityBins / kSurvivorThreads;
constexpr int kWarps = kSurvivorThreads / 32;
constexpr int kLanesPerPoint = 4;
constexpr int kPointsPerWarp = 32 / kLanesPerPoint;

// The highest bin from which on there are num_wanted points, or the lowest of all; in num_above the number of points in
// higher bins than each. For all threads of a block.
__device__ int FindThresholdBin(const std::int32_t* bins, int num_wanted, std::int32_t* num_above,
                                std::int32_t* warp_sums, int* result) {
  // Thread 0 has the highest bins.
  const int first_bin = kPriorityBins - (threadIdx.x + 1) * kBinsPerThread;
  std::int32_t counts[kBinsPerThread];  // then those above each
  std::int32_t sum = 0;
#pragma unroll
  for (int i = 0; i < kBinsPerThread; i += 4) {
    const int4 four = __ldcg(reinterpret_cast<const int4*>(bins + first_bin + i));
    counts[i] = four.x;
    counts[i + 1] = four.y;
    counts[i + 2] = four.z;
    counts[i + 3] = four.w;
    sum += four.x + four.y + four.z + four.w;
  }
  std::int32_t inclusive = sum;
  const int lane = threadIdx.x % 32;
#pragma unroll
  for (int step = 1; step < 32; step *= 2) {
    const std::int32_t before = __shfl_up_sync(0xffffffffu, inclusive, step);
    if (lane >= step) inclusive += before;
  }
  if (lane == 31) warp_sums[threadIdx.x / 32] = inclusive;
  if (threadIdx.x == 0) *result = 0;
  __syncthreads();
  std::int32_t above = inclusive - sum;
  for (int warp = 0; warp < static_cast<int>(threadIdx.x) / 32; ++warp) above += warp_sums[warp];
#pragma unroll
  for (int i = kBinsPerThread - 1; i >= 0; --i) {
    const std::int32_t count = counts[i];
    counts[i] = above;
    if (above < num_wanted && above + count >= num_wanted) *result = first_bin + i;
    above += count;
  }
#pragma unroll
  for (int i = 0; i < kBinsPerThread; i += 4) {
    *reinterpret_cast<int4*>(num_above + first_bin + i) =
        make_int4(counts[i], counts[i + 1], counts[i + 2], counts[i + 3]);
  }
  __syncthreads();
  return *result;
}

// Whether `other` comes before `mine` among points of the same response.
__device__ __forceinline__ bool IsEqualBefore(const CellPoint& other, const CellPoint& mine) {
  return other.response == mine.response && other.tie < mine.tie;
}

// Whether two extrema settled at the very same point.
__device__ bool AreTwins(const ExtractBuffers& buffers, int index, int other) {
  const ScaleSpacePoint a = buffers.points[index];
  const ScaleSpacePoint b = buffers.points[other];
  return a.x == b.x && a.y == b.y && a.scale == b.scale && buffers.keys[index].octave == buffers.keys[other].octave;
}

// A block to a cell.
__global__ void __launch_bounds__(kCellThreads) PriorityKernel(const __grid_constant__ ExtractBuffers buffers) {
  __shared__ CellPoint cell[kMaxPointsPerCell];
  WaitForKernelBefore();
  const float halvings_per_rank = buffers.params->halvings_per_rank;
  const int num_points = min(buffers.cell_counts[blockIdx.x], kMaxPointsPerCell);
  const CellPoint* points = buffers.cell_points + static_cast<std::size_t>(blockIdx.x) * kMaxPointsPerCell;
  for (int i = threadIdx.x; i < num_points; i += kCellThreads) cell[i] = points[i];
  __syncthreads();
  // Some lanes to a point, each with its share of the others. All lanes of a warp stay in the loop together.
  const int part = threadIdx.x % kLanesPerPoint;
  for (int first = threadIdx.x / 32 * kPointsPerWarp; first < num_points; first += kCellThreads / kLanesPerPoint) {
    const int i = first + threadIdx.x % 32 / kLanesPerPoint;
    const CellPoint mine = cell[min(i, num_points - 1)];
    const int index = mine.point;
    int rank = 0;
    int num_equal = 0;
    int last_equal = 0;
#pragma unroll 4
    for (int j = part; j < num_points; j += kLanesPerPoint) {
      const CellPoint other = cell[j];
      const bool is_equal_before = IsEqualBefore(other, mine);
      rank += other.response > mine.response || is_equal_before ? 1 : 0;
      num_equal += is_equal_before ? 1 : 0;
      last_equal = is_equal_before ? j : last_equal;
    }
    // Points of the same response are few: back from the last one.
    int is_twin = 0;
    for (int j = last_equal; num_equal > 0; j -= kLanesPerPoint) {
      if (!IsEqualBefore(cell[j], mine)) continue;
      is_twin |= AreTwins(buffers, index, cell[j].point) ? 1 : 0;
      --num_equal;
    }
    __syncwarp();
#pragma unroll
    for (int step = 1; step < kLanesPerPoint; step *= 2) {
      rank += __shfl_xor_sync(0xffffffffu, rank, step);
      is_twin |= __shfl_xor_sync(0xffffffffu, is_twin, step);
    }
    if (part != 0 || i >= num_points) continue;
    if (is_twin != 0) buffers.keys[index].is_twin = 1;
    const float priority = mine.response * exp2f(-static_cast<float>(rank) * halvings_per_rank);
    const std::uint32_t bits = __float_as_uint(priority);
    buffers.priorities[index] = static_cast<std::uint64_t>(bits) << 32 | (0xffffffffu - mine.tie);
    atomicAdd(&buffers.counters->bins[bits >> kPriorityBinShift], 1);
  }
}

// Leaves out the points that are surely not selected, and puts the others in order of their bins. Every block counts
// the bins through, which is quicker than to wait for one that does.
__global__ void __launch_bounds__(kSurvivorThreads) SurvivorKernel(const __grid_constant__ ExtractBuffers buffers) {
  __shared__ __align__(16) std::int32_t num_above[kPriorityBins];
  __shared__ std::int32_t warp_sums[kWarps];
  __shared__ int threshold_bin;
  WaitForKernelBefore();
  FrameCounters& counters = *buffers.counters;
  const int num_points = counters.num_points;
  const int first = blockIdx.x * kSurvivorThreads;
  if (first >= num_points) return;
  const auto priority_of = [&](int point) { return point < num_points ? buffers.priorities[point] : 0; };
  std::uint64_t next = priority_of(first + threadIdx.x);
  const int threshold =
      FindThresholdBin(counters.bins, buffers.params->num_wanted, num_above, warp_sums, &threshold_bin);
  const auto end_of = [&](int bin) { return bin > 0 ? num_above[bin - 1] : num_points; };
  if (first == 0 && threadIdx.x == 0) counters.num_survivors = end_of(threshold);
  const int stride = gridDim.x * kSurvivorThreads;
  for (int i = first + threadIdx.x; i < num_points; i += stride) {
    const std::uint64_t priority = next;
    next = priority_of(i + stride);
    const int bin = static_cast<int>(priority >> (32 + kPriorityBinShift));
    if (bin < threshold) continue;
    const int place = num_above[bin] + atomicAdd(&counters.num_placed[bin], 1);
    buffers.survivor_priorities[place] = priority;
    buffers.survivors[place] = {i, num_above[bin], end_of(bin), 0};
  }
}

}  // namespace

cudaError_t LaunchPriorities(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                             const ExtractBuffers& buffers, cudaStream_t stream) {
  const bool early = settings.can_launch_early != 0;
  const cudaError_t error = LaunchAfter(early, PriorityKernel, layout.num_cells, kCellThreads, 0, stream, buffers);
  if (error != cudaSuccess) return error;
  return LaunchAfter(early, SurvivorKernel, kSurvivorBlocks, kSurvivorThreads, 0, stream, buffers);
}

}  // namespace haustra::kernels::cuda
