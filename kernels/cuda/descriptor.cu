// The limit, places of the features in the output, their descriptors (Lowe 2004, 6; kernels/cpu/sift_kernels_impl.h)
// and keypoints.
#include <cmath>
#include <cstdint>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/patch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

// A thread to a byte of the descriptor.
constexpr int kThreads = kDescriptorBytes;
constexpr int kWarps = kThreads / 32;
constexpr int kSide = (kDescriptorCells + 1) * kDescriptorSamplesPerCell;
constexpr int kNumSamples = kSide * kSide;
static_assert(kDescriptorCells == 4 && kDescriptorOrientations == 8);
constexpr int kRanksPerThread = kRanksPerChunk / kThreads;
static_assert(kRanksPerThread == 16);

struct Scratch {
  std::int32_t histogram[kDescriptorBytes];  // in units of 1 / kUnits: sums of integers have no order
  float sums[2][kWarps];
  int counts[2][kWarps];
  alignas(16) std::uint32_t kept[kRanksPerChunk / 4];  // angles within the limit, a byte a rank
};
// A sample of at most 65535 * sqrt(2) counts stays below 2^23, and a cell's 36 below 2^31.
constexpr float kUnits = 64.0f;

// Gradients at the points of a grid around a keypoint, taken at the pixel nearest to each point, shared out among four
// cells and two orientations each.
__device__ void CollectGradients(const PlaneValue* __restrict__ level, const OctaveLayout& octave, float x, float y,
                                 float ux, float uy, std::int32_t* histogram) {
  constexpr int kReach = kDescriptorGradientReachPx;
  constexpr float kSigma = kDescriptorWindowSigma * kDescriptorSamplesPerCell;  // spacings
  const float first = static_cast<float>(kReach);
  const float last_x = static_cast<float>(octave.width - 1 - kReach);
  const float last_y = static_cast<float>(octave.height - 1 - kReach);
  const int down = kReach * octave.stride;
#pragma unroll
  for (int i = threadIdx.x; i < kNumSamples; i += kThreads) {
    const float u = static_cast<float>(i % kSide) - 0.5f * (kSide - 1);
    const float v = static_cast<float>(i / kSide) - 0.5f * (kSide - 1);
    const float px = x + u * ux - v * uy + 0.5f;
    const float py = y + u * uy + v * ux + 0.5f;
    const bool is_inside = px >= first && py >= first && px < last_x + 1.0f && py < last_y + 1.0f;
    const int ix = ToWholePart(fminf(fmaxf(px, first), last_x)).integer;
    const int iy = ToWholePart(fminf(fmaxf(py, first), last_y)).integer;
    const PlaneValue* at = level + static_cast<std::ptrdiff_t>(iy) * octave.stride + ix;
    const float dx = OnBase(__ldg(at + kReach)) - OnBase(__ldg(at - kReach));
    const float dy = OnBase(__ldg(at + down)) - OnBase(__ldg(at - down));
    const float weight = __expf(-(u * u + v * v) / (2 * kSigma * kSigma));
    // The axes have the length of the grid's spacing, which an angle does not notice.
    const float position = Atan2(dy * ux - dx * uy, dx * ux + dy * uy) * (kDescriptorOrientations / kTwoPi);
    const float magnitude = is_inside ? sqrtf(dx * dx + dy * dy) * (weight * kUnits) : 0.0f;
    const WholePart lower = ToWholePart(position);
    const float upper_part = position - lower.value;
    const int bins[2] = {lower.integer & (kDescriptorOrientations - 1),
                         (lower.integer + 1) & (kDescriptorOrientations - 1)};
    const float parts[2] = {1.0f - upper_part, upper_part};
    // Samples lie between the centres of two cells each way; cells outside the descriptor are dropped.
    const int column = i % kSide / kDescriptorSamplesPerCell;
    const int row = i / kSide / kDescriptorSamplesPerCell;
    const float column_after =
        (static_cast<float>(i % kSide % kDescriptorSamplesPerCell) + 0.5f) / kDescriptorSamplesPerCell;
    const float row_after =
        (static_cast<float>(i / kSide % kDescriptorSamplesPerCell) + 0.5f) / kDescriptorSamplesPerCell;
#pragma unroll
    for (int r = 0; r < 2; ++r) {
      const int cell_row = row - 1 + r;
      if (cell_row < 0 || cell_row >= kDescriptorCells) continue;
      const float row_magnitude = magnitude * (r == 0 ? 1.0f - row_after : row_after);
#pragma unroll
      for (int c = 0; c < 2; ++c) {
        const int cell_column = column - 1 + c;
        if (cell_column < 0 || cell_column >= kDescriptorCells) continue;
        const float share = row_magnitude * (c == 0 ? 1.0f - column_after : column_after);
        std::int32_t* cell = histogram + (cell_row * kDescriptorCells + cell_column) * kDescriptorOrientations;
#pragma unroll
        for (int k = 0; k < 2; ++k) {
          atomicAdd(cell + bins[k], __float_as_int(fmaf(share, parts[k], kIntegerBase)) - kIntegerBaseBits);
        }
      }
    }
  }
}

__device__ float BlockSum(float value, float* warp_sums) {
#pragma unroll
  for (int step = 16; step > 0; step /= 2) value += __shfl_xor_sync(0xffffffffu, value, step);
  if (threadIdx.x % 32 == 0) warp_sums[threadIdx.x / 32] = value;
  __syncthreads();
  return (warp_sums[0] + warp_sums[1]) + (warp_sums[2] + warp_sums[3]);
}

// Byte threadIdx.x of the descriptor.
__device__ std::uint32_t Describe(const PlaneValue* __restrict__ level, const OctaveLayout& octave,
                                  const ScaleSpacePoint& point, float angle, int root_sift, Scratch& scratch) {
  const float spacing = kDescriptorCellSize / kDescriptorSamplesPerCell * point.scale;
  float sine = 0.0f;
  float cosine = 0.0f;
  __sincosf(angle, &sine, &cosine);
  scratch.histogram[threadIdx.x] = 0;
  __syncthreads();
  CollectGradients(level, octave, point.x, point.y, spacing * cosine, spacing * sine, scratch.histogram);
  __syncthreads();
  const float value = static_cast<float>(scratch.histogram[threadIdx.x]);
  const float squares = BlockSum(value * value, scratch.sums[0]);
  if (squares <= 0.0f) return 0;
  const float clipped = fminf(value, kDescriptorClip * sqrtf(squares));
  const float total = BlockSum(root_sift ? clipped : clipped * clipped, scratch.sums[1]);
  const float scaled = (root_sift ? sqrtf(clipped) : clipped) * (kDescriptorNorm / sqrtf(total)) + 0.5f;
  return static_cast<std::uint32_t>(fminf(scaled, 255.0f));
}

// The order of the output when the short keys are equal: y and octave are then, x may differ in the bits cut off. For
// one angle each, of different points.
__device__ bool GoesBefore(const ExtractBuffers& buffers, int point_a, float angle_a, int point_b, float angle_b) {
  const ScaleSpacePoint a = buffers.points[point_a];
  const ScaleSpacePoint b = buffers.points[point_b];
  if (a.x != b.x) return a.x < b.x;
  if (angle_a != angle_b) return angle_a < angle_b;
  if (a.scale != b.scale) return a.scale < b.scale;
  return buffers.keys[point_a].tie < buffers.keys[point_b].tie;
}

// Of the angles of rank `other`, those that go before angle `angle_idx` of `rank`, which has the same short key.
__device__ int NumBeforeAtSamePlace(const ExtractBuffers& buffers, int other, int num_angles, int rank, int angle_idx) {
  const SelectedPoint* mine = buffers.selected + rank;
  const SelectedPoint* theirs = buffers.selected + other;
  const float my_angle = mine->angles[angle_idx];
  int count = 0;
  for (int k = 0; k < num_angles; ++k) {
    const float angle = theirs->angles[k];
    const bool goes_before = other == rank ? k != angle_idx && angle < my_angle
                                           : GoesBefore(buffers, theirs->point, angle, mine->point, my_angle);
    count += goes_before ? 1 : 0;
  }
  return count;
}

struct Place {
  int place = 0;     // of the feature in the output; -1: beyond the limit, or a twin
  int num_features;  // of the whole output
};

// Features are counted in order of rank until the limit; the place of one is the number of those that go before it.
__device__ Place FindPlace(const ExtractBuffers& buffers, int rank, int angle_idx, int num_wanted, Scratch& scratch) {
  const std::uint64_t my_place = buffers.places[rank];
  const int lane = threadIdx.x % 32;
  const int warp = threadIdx.x / 32;
  int num_before = 0;
  int num_kept = 0;
  int num_taken = 0;  // of the limit, by the chunks before
  bool is_within = false;
  for (int first = 0; first < num_wanted; first += kRanksPerChunk) {
    const int first_rank = first + threadIdx.x * kRanksPerThread;
    const uint4 packed = __ldg(reinterpret_cast<const uint4*>(buffers.angle_counts + first_rank));
    const std::uint32_t words[4] = {packed.x, packed.y, packed.z, packed.w};
    int sum = 0;
#pragma unroll
    for (int w = 0; w < 4; ++w) sum = __dp4a(words[w] & 0x03030303u, 0x01010101u, static_cast<std::uint32_t>(sum));
    int inclusive = sum;
#pragma unroll
    for (int step = 1; step < 32; step *= 2) {
      const int before = __shfl_up_sync(0xffffffffu, inclusive, step);
      if (lane >= step) inclusive += before;
    }
    if (lane == 31) scratch.counts[0][warp] = inclusive;
    __syncthreads();
    int taken = num_taken + inclusive - sum;
#pragma unroll
    for (int w = 0; w < kWarps; ++w) {
      if (w < warp) taken += scratch.counts[0][w];
      num_taken += scratch.counts[0][w];
    }
    // What the limit leaves of the ranks of this thread, for all threads.
    std::uint32_t kept[4] = {words[0], words[1], words[2], words[3]};
    constexpr std::uint32_t kTwinFlags = 0x01010101u * kTwinFlag;
    if (taken + sum > num_wanted || ((words[0] | words[1] | words[2] | words[3]) & kTwinFlags) != 0) {
#pragma unroll
      for (int i = 0; i < kRanksPerThread; ++i) {
        const int shift = 8 * (i % 4);
        const std::uint32_t byte = words[i / 4] >> shift & 255;
        const int count = byte & kCountMask;
        const int left = (byte & kTwinFlag) != 0 ? 0 : min(count, max(num_wanted - taken, 0));
        taken += count;
        kept[i / 4] = (kept[i / 4] & ~(255u << shift)) | static_cast<std::uint32_t>(left) << shift;
      }
    }
#pragma unroll
    for (int w = 0; w < 4; ++w) num_kept = __dp4a(kept[w], 0x01010101u, static_cast<std::uint32_t>(num_kept));
    reinterpret_cast<uint4*>(scratch.kept)[threadIdx.x] = make_uint4(kept[0], kept[1], kept[2], kept[3]);
    __syncthreads();
    // Two ranks to a thread at a time, those of a warp side by side.
#pragma unroll
    for (int i = 2 * threadIdx.x; i < kRanksPerChunk; i += 2 * kThreads) {
      const ulonglong2 two = *reinterpret_cast<const ulonglong2*>(buffers.places + first + i);
      const std::uint32_t counts = reinterpret_cast<const std::uint16_t*>(scratch.kept)[i / 2];
#pragma unroll
      for (int e = 0; e < 2; ++e) {
        const int other = first + i + e;
        const int count = counts >> (8 * e) & 255;
        const std::uint64_t place = e == 0 ? two.x : two.y;
        if (place < my_place) num_before += count;
        if (place == my_place && count > 0) {
          if (other == rank) is_within = angle_idx < count;
          num_before += NumBeforeAtSamePlace(buffers, other, count, rank, angle_idx);
        }
      }
    }
  }
  num_before = __reduce_add_sync(0xffffffffu, num_before);
  num_kept = __reduce_add_sync(0xffffffffu, num_kept);
  if (lane == 0) {
    scratch.counts[0][warp] = num_before;
    scratch.counts[1][warp] = num_kept;
  }
  const bool is_any_within = __syncthreads_or(is_within) != 0;
  Place place;
  place.num_features = 0;
#pragma unroll
  for (int w = 0; w < kWarps; ++w) {
    place.place += scratch.counts[0][w];
    place.num_features += scratch.counts[1][w];
  }
  if (!is_any_within) place.place = -1;
  return place;
}

struct DescriptorScratch {
  Scratch of_threads;
  std::uint32_t bytes[kThreads / 4];
};

// One angle of a rank, by a block.
__device__ void MakeFeature(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, const SetBuffers& sets,
                            const FrameOutput& output, int root_sift, int rank, int angle_idx,
                            DescriptorScratch& all_scratch) {
  Scratch& scratch = all_scratch.of_threads;
  std::uint32_t* bytes = all_scratch.bytes;
  const int num_wanted = buffers.params->num_wanted;
  const bool is_first = rank == 0 && angle_idx == 0;  // tells how many there are, even when there is none
  if (!is_first && angle_idx >= (buffers.angle_counts[rank] & kCountMask)) return;
  const Place place = FindPlace(buffers, rank, angle_idx, num_wanted, scratch);
  if (is_first && threadIdx.x == 0) *output.num_features = place.num_features;
  if (place.place < 0) return;

  const SelectedPoint selected = buffers.selected[rank];
  const float angle = selected.angles[angle_idx];
  const ScaleSpacePoint point = buffers.points[selected.point];
  const PointKey key = buffers.keys[selected.point];
  const OctaveLayout& octave = layout.octaves[key.octave];
  const std::size_t row = static_cast<std::size_t>(buffers.params->set_index) * sets.max_features + place.place;
  if (threadIdx.x == 0) {
    const float to_input = ToInput(octave.octave);
    const Keypoint keypoint = {point.x * to_input, point.y * to_input, point.scale * to_input, angle,
                               point.response,     octave.octave};
    sets.keypoints[row] = keypoint;
    output.keypoints[place.place] = keypoint;
  }
  const std::uint32_t byte =
      Describe(buffers.planes + octave.first_value + (key.level + kDescriptorLevelOffset) * octave.plane_size, octave,
               point, angle, root_sift, scratch);
  reinterpret_cast<std::uint8_t*>(bytes)[threadIdx.x] = static_cast<std::uint8_t>(byte);
  __syncthreads();
  if (threadIdx.x < 32) {
    const std::uint32_t word = bytes[threadIdx.x];
    reinterpret_cast<std::uint32_t*>(sets.descriptors)[row * (kDescriptorBytes / 4) + threadIdx.x] = word;
    const std::uint32_t squares = __reduce_add_sync(0xffffffffu, __dp4a(word, word, 0u));
    if (threadIdx.x == 0) {
      sets.inverse_norms[row] = squares > 0 ? __fdiv_rn(1.0f, __fsqrt_rn(static_cast<float>(squares))) : 0.0f;
    }
  }
}

// A block to a rank and its first angle; the blocks beyond take further angles.
__global__ void __launch_bounds__(kThreads)
    DescriptorKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                     const __grid_constant__ SetBuffers sets, const __grid_constant__ FrameOutput output,
                     int root_sift, int num_ranks) {
  __shared__ DescriptorScratch scratch;
  WaitForKernelBefore();
  const int num_angles = num_ranks + buffers.counters->num_further;
  for (int i = blockIdx.x; i < num_angles; i += gridDim.x) {
    const std::uint32_t further = i < num_ranks ? 0 : buffers.further[i - num_ranks];
    const int rank = i < num_ranks ? i : static_cast<int>(further >> kFurtherShift);
    MakeFeature(layout, buffers, sets, output, root_sift, rank, further & ((1 << kFurtherShift) - 1), scratch);
    __syncthreads();
  }
  Complete({output.done, buffers.params->number}, &buffers.counters->num_described, gridDim.x);
}

}  // namespace

cudaError_t LaunchDescriptors(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                              const ExtractBuffers& buffers, const SetBuffers& sets, const FrameOutput& output,
                              cudaStream_t stream) {
  // Few points have more than one angle; what there is beyond the blocks is taken in turn.
  const int num_blocks = settings.num_features + settings.num_features / 8 + 1;
  return LaunchAfter(settings.can_launch_early, DescriptorKernel, num_blocks, kThreads, 0, stream, layout, buffers,
                     sets, output, settings.root_sift, settings.num_features);
}

}  // namespace haustra::kernels::cuda
