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

// A warp to a feature, so that the places of kWarps features are found in one pass.
constexpr int kThreads = 128;
constexpr int kWarps = kThreads / 32;
constexpr int kSide = (kDescriptorCells + 1) * kDescriptorSamplesPerCell;
constexpr int kNumSamples = kSide * kSide;
static_assert(kDescriptorCells == 4 && kDescriptorOrientations == 8);
constexpr int kRanksPerThread = kRanksPerChunk / kThreads;
static_assert(kRanksPerThread == 16);

struct Scratch {
  alignas(16) std::int32_t
      histograms[kWarps][kDescriptorBytes];  // in units of 1 / kUnits: sums of integers have no order
  int sums[kWarps];                          // of the warps
  int num_kept[kWarps];
  int num_before[kWarps][kWarps];                      // of each feature, by warp
  alignas(16) std::uint32_t kept[kRanksPerChunk / 4];  // angles within the limit, a byte a rank
};
// A sample of at most 65535 * sqrt(2) counts stays below 2^23, and a cell's 36 below 2^31.
constexpr float kUnits = 64.0f;

// Gradients at the points of a grid around a keypoint, taken at the pixel nearest to each point, shared out among four
// cells and two orientations each. By a warp.
__device__ void CollectGradients(const PlaneValue* __restrict__ level, const OctaveLayout& octave, float x, float y,
                                 float ux, float uy, std::int32_t* histogram) {
  constexpr int kReach = kDescriptorGradientReachPx;
  constexpr float kSigma = kDescriptorWindowSigma * kDescriptorSamplesPerCell;  // spacings
  const float first = static_cast<float>(kReach);
  const float last_x = static_cast<float>(octave.width - 1 - kReach);
  const float last_y = static_cast<float>(octave.height - 1 - kReach);
  const int down = kReach * octave.stride;
#pragma unroll 4
  for (int k = 0; k < (kNumSamples + 31) / 32; ++k) {
    const int i = threadIdx.x % 32 + 32 * k;  // beyond the last, samples are of cells outside
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

__device__ __forceinline__ float WarpSum(float value) {
#pragma unroll
  for (int step = 16; step > 0; step /= 2) value += __shfl_xor_sync(0xffffffffu, value, step);
  return value;
}

// By a warp: lane i has bytes 4 * i to 4 * i + 3 of the descriptor.
__device__ std::uint32_t Describe(const PlaneValue* __restrict__ level, const OctaveLayout& octave,
                                  const ScaleSpacePoint& point, float angle, int root_sift, std::int32_t* histogram) {
  static_assert(kDescriptorBytes == 4 * 32);
  const float spacing = kDescriptorCellSize / kDescriptorSamplesPerCell * point.scale;
  float sine = 0.0f;
  float cosine = 0.0f;
  __sincosf(angle, &sine, &cosine);
  int4* mine = reinterpret_cast<int4*>(histogram) + threadIdx.x % 32;
  *mine = make_int4(0, 0, 0, 0);
  __syncwarp();
  CollectGradients(level, octave, point.x, point.y, spacing * cosine, spacing * sine, histogram);
  __syncwarp();
  const int4 sums = *mine;
  const float values[4] = {static_cast<float>(sums.x), static_cast<float>(sums.y), static_cast<float>(sums.z),
                           static_cast<float>(sums.w)};
  float squares = 0.0f;
#pragma unroll
  for (const float value : values) squares += value * value;
  squares = WarpSum(squares);
  if (squares <= 0.0f) return 0;
  const float highest = kDescriptorClip * sqrtf(squares);
  float clipped[4];
  float total = 0.0f;
#pragma unroll
  for (int i = 0; i < 4; ++i) {
    clipped[i] = fminf(values[i], highest);
    total += root_sift ? clipped[i] : clipped[i] * clipped[i];
  }
  const float factor = kDescriptorNorm / sqrtf(WarpSum(total));
  std::uint32_t word = 0;
#pragma unroll
  for (int i = 0; i < 4; ++i) {
    const float scaled = (root_sift ? sqrtf(clipped[i]) : clipped[i]) * factor + 0.5f;
    word |= static_cast<std::uint32_t>(fminf(scaled, 255.0f)) << (8 * i);
  }
  return word;
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

// An angle of a rank, in order of rank first, further angles then.
struct Feature {
  int rank = 0;
  int angle_idx = 0;
  bool is_there = false;
};

__device__ __forceinline__ Feature FeatureAt(const ExtractBuffers& buffers, int i, int num_ranks, int num_angles) {
  if (i >= num_angles) return {};
  if (i < num_ranks) return {i, 0, (buffers.angle_counts[i] & kCountMask) > 0};
  const std::uint32_t further = buffers.further[i - num_ranks];
  return {static_cast<int>(further >> kFurtherShift), static_cast<int>(further & ((1 << kFurtherShift) - 1)), true};
}

struct Place {
  int place;         // of the warp's feature in the output; -1: beyond the limit, or a twin
  int num_features;  // of the whole output
};

// Features are counted in order of rank until the limit; the place of one is the number of those that go before it. By
// a block, for a feature of each warp.
__device__ Place FindPlaces(const ExtractBuffers& buffers, const Feature (&features)[kWarps], const Feature& mine,
                            int num_wanted, Scratch& scratch) {
  const int lane = threadIdx.x % 32;
  const int warp = threadIdx.x / 32;
  std::uint64_t places[kWarps];
#pragma unroll
  for (int f = 0; f < kWarps; ++f) places[f] = buffers.places[features[f].rank];
  int num_before[kWarps] = {};
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
    if (lane == 31) scratch.sums[warp] = inclusive;
    __syncthreads();
    int taken = num_taken + inclusive - sum;
#pragma unroll
    for (int w = 0; w < kWarps; ++w) {
      if (w < warp) taken += scratch.sums[w];
      num_taken += scratch.sums[w];
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
    const int my_rank = mine.rank - first;
    if (my_rank >= 0 && my_rank < kRanksPerChunk) {
      is_within = mine.angle_idx < reinterpret_cast<const std::uint8_t*>(scratch.kept)[my_rank];
    }
    // Two ranks to a thread at a time, those of a warp side by side.
#pragma unroll
    for (int i = 2 * threadIdx.x; i < kRanksPerChunk; i += 2 * kThreads) {
      const ulonglong2 two = *reinterpret_cast<const ulonglong2*>(buffers.places + first + i);
      const std::uint32_t counts = reinterpret_cast<const std::uint16_t*>(scratch.kept)[i / 2];
#pragma unroll
      for (int e = 0; e < 2; ++e) {
        const std::uint64_t place = e == 0 ? two.x : two.y;
        const int count = counts >> (8 * e) & 255;
        // Octave and y decide, nearly always; only a feature's own rank has the same, but for a few others.
        const auto high = [](std::uint64_t of) { return static_cast<std::uint32_t>(of >> 32); };
        bool is_any_equal = false;
#pragma unroll
        for (int f = 0; f < kWarps; ++f) {
          if (high(place) < high(places[f])) num_before[f] += count;
          is_any_equal |= high(place) == high(places[f]);
        }
        if (!is_any_equal || count == 0) continue;
#pragma unroll
        for (int f = 0; f < kWarps; ++f) {
          if (high(place) != high(places[f]) || place > places[f]) continue;
          num_before[f] += place < places[f] ? count
                                             : NumBeforeAtSamePlace(buffers, first + i + e, count, features[f].rank,
                                                                    features[f].angle_idx);
        }
      }
    }
  }
#pragma unroll
  for (int f = 0; f < kWarps; ++f) {
    num_before[f] = __reduce_add_sync(0xffffffffu, num_before[f]);
    if (lane == 0) scratch.num_before[f][warp] = num_before[f];
  }
  num_kept = __reduce_add_sync(0xffffffffu, num_kept);
  if (lane == 0) scratch.num_kept[warp] = num_kept;
  __syncthreads();
  Place place = {0, 0};
#pragma unroll
  for (int w = 0; w < kWarps; ++w) {
    place.place += scratch.num_before[warp][w];
    place.num_features += scratch.num_kept[w];
  }
  if (!is_within || !mine.is_there) place.place = -1;
  return place;
}

// Keypoint and descriptor of a feature, by a warp.
__device__ void WriteFeature(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, const SetBuffers& sets,
                             const FrameOutput& output, int root_sift, const Feature& feature, int place,
                             std::int32_t* histogram) {
  const int lane = threadIdx.x % 32;
  const SelectedPoint* selected = buffers.selected + feature.rank;
  const float angle = selected->angles[feature.angle_idx];
  const ScaleSpacePoint point = buffers.points[selected->point];
  const PointKey key = buffers.keys[selected->point];
  const OctaveLayout& octave = layout.octaves[key.octave];
  const std::size_t row = static_cast<std::size_t>(buffers.params->set_index) * sets.max_features + place;
  if (lane == 0) {
    const float to_input = ToInput(octave.octave);
    const Keypoint keypoint = {point.x * to_input, point.y * to_input, point.scale * to_input, angle,
                               point.response,     octave.octave};
    sets.keypoints[row] = keypoint;
    output.keypoints[place] = keypoint;
  }
  const std::uint32_t word =
      Describe(buffers.planes + octave.first_value + (key.level + kDescriptorLevelOffset) * octave.plane_size, octave,
               point, angle, root_sift, histogram);
  reinterpret_cast<std::uint32_t*>(sets.descriptors)[row * (kDescriptorBytes / 4) + lane] = word;
  const std::uint32_t squares = __reduce_add_sync(0xffffffffu, __dp4a(word, word, 0u));
  if (lane == 0) {
    sets.inverse_norms[row] = squares > 0 ? __fdiv_rn(1.0f, __fsqrt_rn(static_cast<float>(squares))) : 0.0f;
  }
}

__global__ void __launch_bounds__(kThreads, 5)
    DescriptorKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                     const __grid_constant__ SetBuffers sets, const __grid_constant__ FrameOutput output, int root_sift,
                     int num_ranks) {
  __shared__ Scratch scratch;
  const int warp = threadIdx.x / 32;
  WaitForKernelBefore();
  const int num_wanted = buffers.params->num_wanted;
  const int num_angles = num_ranks + buffers.counters->num_further;
  for (int first = kWarps * blockIdx.x; first < num_angles; first += kWarps * gridDim.x) {
    Feature features[kWarps];
    bool is_any_there = first == 0;  // tells how many there are, even when there is none
#pragma unroll
    for (int f = 0; f < kWarps; ++f) {
      features[f] = FeatureAt(buffers, first + f, num_ranks, num_angles);
      is_any_there |= features[f].is_there;
    }
    if (!is_any_there) continue;
    const Feature mine = FeatureAt(buffers, first + warp, num_ranks, num_angles);
    const Place place = FindPlaces(buffers, features, mine, num_wanted, scratch);
    if (first == 0 && threadIdx.x == 0) *output.num_features = place.num_features;
    if (place.place >= 0) {
      WriteFeature(layout, buffers, sets, output, root_sift, mine, place.place, scratch.histograms[warp]);
    }
    __syncthreads();
  }
  Complete({output.done, buffers.params->number}, &buffers.counters->num_described, gridDim.x);
}

}  // namespace

cudaError_t LaunchDescriptors(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                              const ExtractBuffers& buffers, const SetBuffers& sets, const FrameOutput& output,
                              cudaStream_t stream) {
  // Few points have more than one angle; what there is beyond the blocks is taken in turn.
  const int num_blocks = (settings.num_features + settings.num_features / 8) / kWarps + 1;
  return LaunchAfter(settings.can_launch_early, DescriptorKernel, num_blocks, kThreads, 0, stream, layout, buffers,
                     sets, output, settings.root_sift, settings.num_features);
}

}  // namespace haustra::kernels::cuda
