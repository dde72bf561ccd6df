// Ranks of the points by priority, and the orientations of those that are selected.
#include <cstdint>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/patch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

// A warp to a point.
constexpr int kThreads = 128;
constexpr int kWarps = kThreads / 32;
constexpr int kBins = kOrientationBins + 2;  // the last two wrap around: an angle may round up to a full turn

// Of a warp. A histogram for each lane: bin b of lane t is at b * 32 + t, so that no two lanes meet and sums have one
// order.
struct Scratch {
  float histograms[kBins * 32];
  float sums[kBins];
  float smooth[kOrientationBins];
};

// Gradients of the disc around the point, into the histogram of each lane.
__device__ void CollectGradients(const PlaneValue* __restrict__ level, const OctaveLayout& octave,
                                 const ScaleSpacePoint& point, float* histogram) {
  const int centre_x = static_cast<int>(point.x);
  const int centre_y = static_cast<int>(point.y);
  const int reach = min(max(static_cast<int>(kOrientationReachSigmas * kOrientationWindowSigma * point.scale) + 1, 1),
                        kOrientationReachPx);
  const float falloff = -0.5f / (kOrientationWindowSigma * kOrientationWindowSigma * point.scale * point.scale);
  // 2 * reach rows; lanes go through the square around the disc. Small integers are kept as floats too: that takes
  // fewer conversions.
  const int side = 2 * reach;
  const int first_x = centre_x + 1 - reach;
  const int first_y = centre_y + 1 - reach;
  const float side_value = static_cast<float>(side);
  const float inverse_side = 1.0f / side_value;
  const float reach_value = 0.5f * side_value;
  const float to_first_x = static_cast<float>(first_x) - point.x;
  const float to_first_y = static_cast<float>(first_y) - point.y;
  float i_value = static_cast<float>(threadIdx.x % 32);
#pragma unroll 4
  for (int i = threadIdx.x % 32; i < side * side; i += 32, i_value += 32.0f) {
    const WholePart row = ToWholePart((i_value + 0.5f) * inverse_side);
    const float column = i_value - row.value * side_value;
    const int x = first_x + i - row.integer * side;
    const int y = first_y + row.integer;
    const float distance_x = to_first_x + column;
    const float distance_y = to_first_y + row.value;
    const float squared_half = reach_value * reach_value - distance_y * distance_y;
    const float half = squared_half > 1.0f ? floorf(sqrtf(squared_half)) : 1.0f;
    const bool is_inside = column - reach_value >= -half && column - reach_value < half && x >= 1 &&
                           x <= octave.width - 2 && y >= 1 && y <= octave.height - 2;
    // Loads are for all, so that they are under way together; outside, of the nearest pixel that has neighbours.
    const int safe_x = min(max(x, 1), octave.width - 2);
    const int safe_y = min(max(y, 1), octave.height - 2);
    const PlaneValue* at = level + static_cast<std::ptrdiff_t>(safe_y) * octave.stride + safe_x;
    const float dx = OnBase(__ldg(at + 1)) - OnBase(__ldg(at - 1));
    const float dy = OnBase(__ldg(at + octave.stride)) - OnBase(__ldg(at - octave.stride));
    const float weight = __expf(falloff * (distance_x * distance_x + distance_y * distance_y));
    const float magnitude = is_inside ? sqrtf(dx * dx + dy * dy) * weight : 0.0f;
    const float position = Atan2(dy, dx) * (kOrientationBins / kTwoPi);
    const WholePart bin = ToWholePart(position);
    const float upper = magnitude * (position - bin.value);
    float* lower_bin = histogram + bin.integer * 32;
    lower_bin[0] += magnitude - upper;
    lower_bin[32] += upper;
  }
}

// The histograms of the lanes in one.
__device__ void AddHistograms(Scratch& scratch) {
  const int lane = threadIdx.x % 32;
  // A bin to a lane, each from another lane's on; of the bins that are left, four lanes to each.
  float sums[4] = {};
#pragma unroll
  for (int t = 0; t < 32; ++t) sums[t % 4] += scratch.histograms[lane * 32 + (t + lane) % 32];
  scratch.sums[lane] = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  constexpr int kRest = kBins - 32;
  static_assert(kRest > 0 && kRest <= 8);
  const int bin = 32 + min(lane / 4, kRest - 1);
  float sum = 0.0f;
#pragma unroll
  for (int t = 0; t < 8; ++t) sum += scratch.histograms[bin * 32 + lane % 4 * 8 + (t + lane / 4) % 8];
  sum += __shfl_xor_sync(0xffffffffu, sum, 1);
  sum += __shfl_xor_sync(0xffffffffu, sum, 2);
  if (lane % 4 == 0 && lane / 4 < kRest) scratch.sums[bin] = sum;
}

// Angles in order of height, at most kMaxOrientations; returns their number. By a warp, from scratch.sums.
__device__ int FindPeaks(Scratch& scratch, float* angles) {
  const int lane = threadIdx.x % 32;
  float highest = 0.0f;
  for (int b = lane; b < kOrientationBins; b += 32) {
    const auto at = [&](int k) {
      const int bin = (b + k + kOrientationBins) % kOrientationBins;
      return scratch.sums[bin] + (bin < 2 ? scratch.sums[bin + kOrientationBins] : 0.0f);
    };
    const float value = (at(-2) + at(2)) * (1.0f / 16) + (at(-1) + at(1)) * (4.0f / 16) + at(0) * (6.0f / 16);
    scratch.smooth[b] = value;
    highest = fmaxf(highest, value);
  }
  highest = __uint_as_float(__reduce_max_sync(0xffffffffu, __float_as_uint(highest)));  // not negative
  __syncwarp();

  std::uint32_t peaks[2];  // one bit a bin
#pragma unroll
  for (int part = 0; part < 2; ++part) {
    const int b = lane + 32 * part;
    bool is_peak = false;
    if (b < kOrientationBins) {
      const float here = scratch.smooth[b];
      const float before = scratch.smooth[(b + kOrientationBins - 1) % kOrientationBins];
      const float after = scratch.smooth[(b + 1) % kOrientationBins];
      is_peak = here >= kOrientationPeakRatio * highest && here > before && here >= after;
    }
    peaks[part] = __ballot_sync(0xffffffffu, is_peak);
  }
  // All lanes go through the few peaks together; ties: lowest bin.
  float heights[kMaxOrientations];
  int count = 0;
  for (std::uint64_t left = peaks[0] | static_cast<std::uint64_t>(peaks[1]) << 32; left != 0; left &= left - 1) {
    const int b = __ffsll(static_cast<long long>(left)) - 1;
    const float before = scratch.smooth[(b + kOrientationBins - 1) % kOrientationBins];
    const float here = scratch.smooth[b];
    const float after = scratch.smooth[(b + 1) % kOrientationBins];
    // Vertex of the parabola through the three.
    float position = static_cast<float>(b) + 0.5f * (before - after) / (before - 2.0f * here + after);
    if (position < 0.0f) position += kOrientationBins;
    float angle = position * (kTwoPi / kOrientationBins);
    if (angle >= kTwoPi) angle = 0.0f;
    float height = here;
#pragma unroll
    for (int k = 0; k < kMaxOrientations; ++k) {
      if (k >= count || heights[k] < height) {
        const float other_height = heights[k];
        const float other_angle = angles[k];
        heights[k] = height;
        angles[k] = angle;
        if (k >= count) {
          ++count;
          break;
        }
        height = other_height;
        angle = other_angle;
      }
    }
  }
  return count;
}

// How many points have a higher priority, by a warp: all of higher bins, and some of the same.
__device__ int FindRank(const ExtractBuffers& buffers, const Survivor& survivor, int place) {
  const std::uint64_t priority = buffers.survivor_priorities[place];
  int num_before = 0;
  for (int i = survivor.first + threadIdx.x % 32; i < survivor.end; i += 32) {
    num_before += buffers.survivor_priorities[i] > priority ? 1 : 0;
  }
  return survivor.first + __reduce_add_sync(0xffffffffu, num_before);
}

// Angles of a survivor that is selected, by a warp.
__device__ void WriteSelected(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int point_idx, int rank,
                              Scratch& scratch) {
  const ScaleSpacePoint point = buffers.points[point_idx];
  const PointKey key = buffers.keys[point_idx];
  const OctaveLayout& octave = layout.octaves[key.octave];
  float angles[kMaxOrientations] = {};
  int count = 1;
  if (!key.is_upright) {  // for the warp as one
    float* histogram = scratch.histograms + threadIdx.x % 32;
#pragma unroll
    for (int b = 0; b < kBins; ++b) histogram[b * 32] = 0.0f;
    CollectGradients(buffers.planes + octave.first_value + key.level * octave.plane_size, octave, point, histogram);
    __syncwarp();
    AddHistograms(scratch);
    __syncwarp();
    count = FindPeaks(scratch, angles);
  }
  if (threadIdx.x % 32 != 0) return;
  SelectedPoint selected{point_idx, {}};
#pragma unroll
  for (int k = 0; k < kMaxOrientations; ++k) selected.angles[k] = angles[k];
  buffers.selected[rank] = selected;
  buffers.angle_counts[rank] = static_cast<std::uint8_t>(count | (key.is_twin ? kTwinFlag : 0));
  if (count > 1) {
    std::uint32_t* further = buffers.further + atomicAdd(&buffers.counters->num_further, count - 1);
    for (int k = 1; k < count; ++k) further[k - 1] = static_cast<std::uint32_t>(rank << kFurtherShift | k);
  }
  const float to_input = ToInput(octave.octave);
  const std::uint64_t x_bits = __float_as_uint(point.x * to_input);
  const std::uint64_t y_bits = __float_as_uint(point.y * to_input);
  buffers.places[rank] = static_cast<std::uint64_t>(key.octave) << 60 | y_bits << 29 | x_bits >> 3;
}

__global__ void __launch_bounds__(kThreads, 5)
    OrientationKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers) {
  __shared__ Scratch scratch[kWarps];
  WaitForKernelBefore();
  const int num_wanted = buffers.params->num_wanted;
  const int num_survivors = buffers.counters->num_survivors;
  for (int i = kWarps * blockIdx.x + threadIdx.x / 32; i < num_survivors; i += kWarps * gridDim.x) {
    const Survivor survivor = buffers.survivors[i];
    const int rank = FindRank(buffers, survivor, i);
    if (rank < num_wanted) WriteSelected(layout, buffers, survivor.point, rank, scratch[threadIdx.x / 32]);
    __syncwarp();
  }
}

}  // namespace

cudaError_t LaunchOrientations(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                               const ExtractBuffers& buffers, cudaStream_t stream) {
  // A few more survive than are selected; what there is beyond is taken in turn.
  const int num_blocks = (settings.num_features + settings.num_features / 8) / kWarps + 1;
  return LaunchAfter(settings.can_launch_early, OrientationKernel, num_blocks, kThreads, 0, stream, layout, buffers);
}

}  // namespace haustra::kernels::cuda
