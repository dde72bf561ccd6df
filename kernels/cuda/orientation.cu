// Ranks of the points by priority, and the orientations of those that are selected.
#include <cstdint>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/patch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kThreads = 64;
constexpr int kBins = kOrientationBins + 2;  // the last two wrap around: an angle may round up to a full turn

// A histogram for each thread: bin b of thread t is at b * kThreads + t, so that no two threads meet and sums have one
// order.
struct Scratch {
  float histograms[kBins * kThreads];
  float sums[kBins];
  float smooth[kOrientationBins];
  int ranks[kThreads / 32];
};

// Gradients of the disc around the point, into the histogram of each thread.
__device__ void CollectGradients(const PlaneValue* __restrict__ level, const OctaveLayout& octave,
                                 const ScaleSpacePoint& point, float* histogram) {
  const int centre_x = static_cast<int>(point.x);
  const int centre_y = static_cast<int>(point.y);
  const int reach = min(max(static_cast<int>(kOrientationReachSigmas * kOrientationWindowSigma * point.scale) + 1, 1),
                        kOrientationReachPx);
  const float falloff = -0.5f / (kOrientationWindowSigma * kOrientationWindowSigma * point.scale * point.scale);
  // 2 * reach rows; threads go through the square around the disc. Small integers are kept as floats too: that takes
  // fewer conversions.
  const int side = 2 * reach;
  const int first_x = centre_x + 1 - reach;
  const int first_y = centre_y + 1 - reach;
  const float side_value = static_cast<float>(side);
  const float inverse_side = 1.0f / side_value;
  const float reach_value = 0.5f * side_value;
  const float to_first_x = static_cast<float>(first_x) - point.x;
  const float to_first_y = static_cast<float>(first_y) - point.y;
  float i_value = static_cast<float>(threadIdx.x);
#pragma unroll 4
  for (int i = threadIdx.x; i < side * side; i += kThreads, i_value += kThreads) {
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
    float* lower_bin = histogram + bin.integer * kThreads;
    lower_bin[0] += magnitude - upper;
    lower_bin[kThreads] += upper;
  }
}

// Angles in order of height, at most kMaxOrientations; returns their number. By the first warp, from scratch.sums.
__device__ int FindPeaks(Scratch& scratch, float* angles) {
  const int lane = threadIdx.x;
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

// A block to a survivor.
__global__ void __launch_bounds__(kThreads, 18)
    OrientationKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers) {
  __shared__ Scratch scratch;
  WaitForKernelBefore();
  const int num_wanted = buffers.params->num_wanted;
  const int num_survivors = buffers.counters->num_survivors;
  for (int i = blockIdx.x; i < num_survivors; i += gridDim.x) {
    const std::uint64_t priority = buffers.survivor_priorities[i];
    const std::int32_t point_idx = buffers.survivor_points[i];
    const ScaleSpacePoint point = buffers.points[point_idx];
    const PointKey key = buffers.keys[point_idx];
    const OctaveLayout& octave = layout.octaves[key.octave];
    int rank = 0;
#pragma unroll 8
    for (int j = 2 * threadIdx.x; j < num_survivors; j += 2 * kThreads) {
      const ulonglong2 two = *reinterpret_cast<const ulonglong2*>(buffers.survivor_priorities + j);
      rank += two.x > priority ? 1 : 0;
      rank += two.y > priority && j + 1 < num_survivors ? 1 : 0;
    }
    rank = __reduce_add_sync(0xffffffffu, rank);
    if (threadIdx.x % 32 == 0) scratch.ranks[threadIdx.x / 32] = rank;
#pragma unroll
    for (int b = 0; b < kBins; ++b) scratch.histograms[b * kThreads + threadIdx.x] = 0.0f;
    __syncthreads();
    rank = scratch.ranks[0] + scratch.ranks[1];
    if (rank < num_wanted) {
      CollectGradients(buffers.planes + octave.first_value + key.level * octave.plane_size, octave, point,
                       scratch.histograms + threadIdx.x);
      __syncthreads();
      if (threadIdx.x < kBins) {
        float sums[4] = {};
#pragma unroll 4
        for (int t = 0; t < kThreads; t += 4) {
#pragma unroll
          for (int k = 0; k < 4; ++k) {
            sums[k] += scratch.histograms[threadIdx.x * kThreads + (t + k + threadIdx.x) % kThreads];
          }
        }
        scratch.sums[threadIdx.x] = (sums[0] + sums[1]) + (sums[2] + sums[3]);
      }
      __syncthreads();
      if (threadIdx.x < 32) {
        float angles[kMaxOrientations] = {};
        const int count = FindPeaks(scratch, angles);
        if (threadIdx.x == 0) {
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
      }
    }
    __syncthreads();
  }
}

}  // namespace

cudaError_t LaunchOrientations(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                               const ExtractBuffers& buffers, cudaStream_t stream) {
  // A few more survive than are selected; what there is beyond is taken in turn.
  const int num_blocks = settings.num_features + settings.num_features / 8 + 1;
  return LaunchAfter(settings.can_launch_early, OrientationKernel, num_blocks, kThreads, 0, stream, layout, buffers);
}

}  // namespace haustra::kernels::cuda
