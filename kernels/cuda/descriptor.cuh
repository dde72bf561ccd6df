// The descriptor of a feature (Lowe 2004, 6; kernels/cpu/sift_kernels_impl.h), by a warp.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/cuda/extract_buffers.h"
#include "kernels/cuda/patch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kSide = (kDescriptorCells + 1) * kDescriptorSamplesPerCell;
constexpr int kNumSamples = kSide * kSide;
static_assert(kDescriptorCells == 4 && kDescriptorOrientations == 8);

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

// The row of a feature, by a warp; word: of the lane, from Describe.
__device__ __forceinline__ void WriteDescriptor(const SetBuffers& sets, std::size_t row, std::uint32_t word) {
  const int lane = threadIdx.x % 32;
  reinterpret_cast<std::uint32_t*>(sets.descriptors)[row * (kDescriptorBytes / 4) + lane] = word;
  const std::uint32_t squares = __reduce_add_sync(0xffffffffu, __dp4a(word, word, 0u));
  if (lane == 0) {
    sets.inverse_norms[row] = squares > 0 ? __fdiv_rn(1.0f, __fsqrt_rn(static_cast<float>(squares))) : 0.0f;
  }
}

}  // namespace
}  // namespace haustra::kernels::cuda
