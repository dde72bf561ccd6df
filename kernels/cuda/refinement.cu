// Refinement of extrema (Lowe 2004, 4; kernels/cpu/sift_refinement.cc).
#include <cstdint>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

// Whether a pixel is within the dilated mask of its octave; x, y in octave pixels. By a warp, a row to a lane.
__device__ bool IsExcluded(const ScaleSpaceLayout& layout, const std::uint32_t* mask_bits, int dilation_px, int octave,
                           float x, float y) {
  if (octave < 0) {
    x *= 0.5f;
    y *= 0.5f;
    dilation_px = (dilation_px + 1) / 2;
    octave = 0;
  }
  const MaskLayout& mask = layout.masks[octave];
  const int first_x = max(static_cast<int>(x) - dilation_px, 0);
  const int last_x = min(static_cast<int>(x) + dilation_px, mask.width - 1);
  const int first_y = max(static_cast<int>(y) - dilation_px, 0);
  const int last_y = min(static_cast<int>(y) + dilation_px, mask.height - 1);
  const int first_word = first_x / 32;
  const int last_word = last_x / 32;
  std::uint32_t any = 0;
  for (int row = first_y + static_cast<int>(threadIdx.x % 32); row <= last_y; row += 32) {
    const std::uint32_t* words = mask_bits + mask.first_word + static_cast<std::ptrdiff_t>(row) * mask.words;
    for (int word = first_word; word <= last_word; ++word) {
      std::uint32_t bits = 0xffffffffu;
      if (word == first_word) bits &= 0xffffffffu << (first_x % 32);
      if (word == last_word) bits &= 0xffffffffu >> (31 - last_x % 32);
      any |= __ldg(words + word) & bits;
    }
  }
  return __any_sync(0xffffffffu, any != 0) != 0;
}

// Value, gradient and Hessian of the difference of Gaussians at a grid point, by central differences.
struct Quadratic {
  float value;
  float gx, gy, gs;
  float hxx, hyy, hss, hxy, hxs, hys;
};

// By a warp: lane (s * 3 + r) * 3 + c has the difference at scale s, row r, column c of the cube around the point.
__device__ Quadratic FitQuadratic(const PlaneValue* at, int stride, std::size_t plane_size) {
  const int lane = min(static_cast<int>(threadIdx.x % 32), 26);
  const PlaneValue* mine =
      at + static_cast<std::ptrdiff_t>(lane / 9) * plane_size + (lane / 3 % 3 - 1) * stride + (lane % 3 - 1);
  const float difference = ToCounts(__ldg(mine + plane_size)) - ToCounts(__ldg(mine));
  const auto d = [&](int s, int r, int c) { return __shfl_sync(0xffffffffu, difference, (s * 3 + r) * 3 + c); };
  Quadratic q;
  q.value = d(1, 1, 1);
  q.gx = 0.5f * (d(1, 1, 2) - d(1, 1, 0));
  q.gy = 0.5f * (d(1, 2, 1) - d(1, 0, 1));
  q.gs = 0.5f * (d(2, 1, 1) - d(0, 1, 1));
  q.hxx = d(1, 1, 2) + d(1, 1, 0) - 2.0f * q.value;
  q.hyy = d(1, 2, 1) + d(1, 0, 1) - 2.0f * q.value;
  q.hss = d(2, 1, 1) + d(0, 1, 1) - 2.0f * q.value;
  q.hxy = 0.25f * (d(1, 2, 2) - d(1, 2, 0) - d(1, 0, 2) + d(1, 0, 0));
  q.hxs = 0.25f * (d(2, 1, 2) - d(2, 1, 0) - d(0, 1, 2) + d(0, 1, 0));
  q.hys = 0.25f * (d(2, 2, 1) - d(2, 0, 1) - d(0, 2, 1) + d(0, 0, 1));
  return q;
}

// Where the gradient vanishes: -H^-1 g, by cofactors. False when H is singular.
__device__ bool SolveOffset(const Quadratic& q, float* dx, float* dy, float* ds) {
  const float c00 = q.hyy * q.hss - q.hys * q.hys;
  const float c01 = q.hxs * q.hys - q.hxy * q.hss;
  const float c02 = q.hxy * q.hys - q.hxs * q.hyy;
  const float c11 = q.hxx * q.hss - q.hxs * q.hxs;
  const float c12 = q.hxy * q.hxs - q.hxx * q.hys;
  const float c22 = q.hxx * q.hyy - q.hxy * q.hxy;
  const float determinant = q.hxx * c00 + q.hxy * c01 + q.hxs * c02;
  if (fabsf(determinant) < 1e-15f) return false;  // of counts
  const float factor = -1.0f / determinant;
  *dx = factor * (c00 * q.gx + c01 * q.gy + c02 * q.gs);
  *dy = factor * (c01 * q.gx + c11 * q.gy + c12 * q.gs);
  *ds = factor * (c02 * q.gx + c12 * q.gy + c22 * q.gs);
  return true;
}

// By a warp, all lanes alike.
__device__ bool Refine(const OctaveLayout& octave, const PlaneValue* planes, float contrast_threshold,
                       float edge_threshold, int x, int y, int level, ScaleSpacePoint* point, int* settled_level) {
  Quadratic q;
  float dx = 0.0f;
  float dy = 0.0f;
  float ds = 0.0f;
  bool has_settled = false;
  for (int step = 0; step < kMaxRefinementSteps; ++step) {
    q = FitQuadratic(planes + octave.first_value + static_cast<std::size_t>(level - 1) * octave.plane_size +
                         static_cast<std::size_t>(y) * octave.stride + x,
                     octave.stride, octave.plane_size);
    if (!SolveOffset(q, &dx, &dy, &ds)) return false;
    if (fabsf(dx) < 0.5f && fabsf(dy) < 0.5f && fabsf(ds) < 0.5f) {
      has_settled = true;
      break;
    }
    // Far away: the quadratic says nothing about this neighbourhood. (Negated to catch NaN.)
    if (!(fabsf(dx) < 8.0f && fabsf(dy) < 8.0f && fabsf(ds) < 8.0f)) return false;
    x += static_cast<int>(roundf(dx));
    y += static_cast<int>(roundf(dy));
    level += static_cast<int>(roundf(ds));
    if (level < 1 || level > kScalesPerOctave || x < kEdgeMarginPx || x >= octave.width - kEdgeMarginPx ||
        y < kEdgeMarginPx || y >= octave.height - kEdgeMarginPx) {
      return false;
    }
  }
  if (!has_settled) return false;

  const float response = fabsf(q.value + 0.5f * (q.gx * dx + q.gy * dy + q.gs * ds)) / kCountsPerUnit;
  if (response < contrast_threshold) return false;
  const float trace = q.hxx + q.hyy;
  const float determinant = q.hxx * q.hyy - q.hxy * q.hxy;
  const float edge = edge_threshold;
  if (determinant <= 0.0f || trace * trace * edge >= (edge + 1.0f) * (edge + 1.0f) * determinant) return false;

  point->x = static_cast<float>(x) + dx;
  point->y = static_cast<float>(y) + dy;
  point->scale = kBaseSigma * exp2f((static_cast<float>(level) + ds) / kScalesPerOctave);
  point->response = response;
  *settled_level = level;
  return true;
}

constexpr int kRefineWarps = 4;
constexpr int kRefineBlocks = 132 * 16;

// A warp to an extremum.
__global__ void __launch_bounds__(32 * kRefineWarps)
    RefineKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractSettings settings,
                 const __grid_constant__ ExtractBuffers buffers) {
  WaitForKernelBefore();
  const int num_extrema = buffers.counters->num_extrema;
  for (int i = blockIdx.x * kRefineWarps + threadIdx.x / 32; i < num_extrema; i += gridDim.x * kRefineWarps) {
    const uint2 extremum = buffers.extrema[i];
    const int x = extremum.x & 0xffff;
    const int y = extremum.x >> 16;
    const int level = extremum.y & 0xff;
    const int slot = extremum.y >> 8;
    const OctaveLayout& octave = layout.octaves[slot];
    ScaleSpacePoint point;
    int settled_level = 0;
    if (!Refine(octave, buffers.planes, settings.contrast_threshold, settings.edge_threshold, x, y, level, &point,
                &settled_level)) {
      continue;
    }
    // Many extrema are too weak or on edges; masks are asked about the others only.
    const int dilation_px = settings.mask_dilation_px;
    const bool was_excluded =
        IsExcluded(layout, buffers.mask_bits, dilation_px, octave.octave, static_cast<float>(x), static_cast<float>(y));
    const bool is_excluded = IsExcluded(layout, buffers.mask_bits, dilation_px, octave.octave, point.x, point.y);
    if (was_excluded || is_excluded) continue;
    if (threadIdx.x % 32 != 0) continue;
    const float to_input = ToInput(octave.octave);
    const int column =
        min(max(static_cast<int>(point.x * to_input) / kSelectionCellPx, 0), layout.num_cell_columns - 1);
    const int row = min(max(static_cast<int>(point.y * to_input) / kSelectionCellPx, 0),
                        layout.num_cells / layout.num_cell_columns - 1);
    const int cell = row * layout.num_cell_columns + column;
    const int place = atomicAdd(&buffers.cell_counts[cell], 1);
    if (place >= kMaxPointsPerCell) continue;  // more than kMaxExtremaPerTile lets through in practice
    const int index = atomicAdd(&buffers.counters->num_points, 1);
    buffers.points[index] = point;
    const std::uint32_t pixel = octave.first_pixel + static_cast<std::uint32_t>(y) * octave.width + x;
    const std::uint32_t tie = pixel * kScalesPerOctave + static_cast<std::uint32_t>(level - 1);
    buffers.keys[index] = {tie, static_cast<std::uint8_t>(slot), static_cast<std::uint8_t>(settled_level), 0, 0};
    buffers.cell_points[static_cast<std::size_t>(cell) * kMaxPointsPerCell + place] = {point.response, tie, index, 0};
  }
}

}  // namespace

cudaError_t LaunchRefinement(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                             const ExtractBuffers& buffers, cudaStream_t stream) {
  RefineKernel<<<kRefineBlocks, 32 * kRefineWarps, 0, stream>>>(layout, settings, buffers);
  return cudaGetLastError();
}

}  // namespace haustra::kernels::cuda
