// The limit, places of the features in the output, their descriptors (Lowe 2004, 6; kernels/cpu/sift_kernels_impl.h)
// and keypoints.
#include <cmath>
#include <cstdint>

#include "kernels/cuda/descriptor.cuh"
#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"

namespace haustra::kernels::cuda {
namespace {

// A warp to a feature, so that the places of kWarps features are found in one pass.
constexpr int kThreads = 128;
constexpr int kWarps = kThreads / 32;
constexpr int kRanksPerThread = kRanksPerChunk / kThreads;
static_assert(kRanksPerThread == 16);

struct Scratch {
  alignas(16) std::int32_t histograms[kWarps][kDescriptorBytes];  // descriptor.cuh
  int sums[kWarps];                                               // of the warps
  int num_kept[kWarps];
  int num_before[kWarps][kWarps];                      // of each feature, by warp
  alignas(16) std::uint32_t kept[kRanksPerChunk / 4];  // angles within the limit, a byte a rank
};

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
  WriteDescriptor(
      sets, row,
      Describe(buffers.planes + octave.first_value + (key.level + kDescriptorLevelOffset) * octave.plane_size, octave,
               point, angle, root_sift, histogram));
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
    if (first == 0 && threadIdx.x == 0) {
      *output.num_features = place.num_features;
      *output.num_detected = place.num_features;
      buffers.counters->num_detected = place.num_features;
    }
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
