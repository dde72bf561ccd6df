// Refinement of extrema (Lowe 2004, 4; kernels/cpu/sift_refinement.cc).
#include <cstdint>

#include "kernels/cuda/exclusion.cuh"
#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kLanesPerPoint = 4;  // a level each: refinement looks at four of them

// Value, gradient and Hessian of the difference of Gaussians at a grid point, by central differences.
struct Quadratic {
  float value;
  float gx, gy, gs;
  float hxx, hyy, hss, hxy, hxs, hys;
};

// By kLanesPerPoint lanes: lane l has the values around the point at level l of the four whose differences count.
__device__ Quadratic FitQuadratic(const PlaneValue* at, int stride) {
  int v[3][3];
#pragma unroll
  for (int r = 0; r < 3; ++r) {
#pragma unroll
    for (int c = 0; c < 3; ++c) v[r][c] = __ldg(at + (r - 1) * stride + (c - 1));
  }
  // Integers, so that sums are exact in any order; of the levels first, of their differences then.
  struct Differences {
    int of[kLanesPerPoint - 1];
  };
  const auto differences = [](int mine) {
    int of_level[kLanesPerPoint];
#pragma unroll
    for (int l = 0; l < kLanesPerPoint; ++l) of_level[l] = __shfl_sync(0xffffffffu, mine, l, kLanesPerPoint);
    return Differences{{of_level[1] - of_level[0], of_level[2] - of_level[1], of_level[3] - of_level[2]}};
  };
  const auto middle_difference = [](int mine) {
    return __shfl_sync(0xffffffffu, mine, 2, kLanesPerPoint) - __shfl_sync(0xffffffffu, mine, 1, kLanesPerPoint);
  };
  const Differences centre = differences(v[1][1]);
  const Differences dx = differences(v[1][2] - v[1][0]);
  const Differences dy = differences(v[2][1] - v[0][1]);
  const int sum_x = middle_difference(v[1][2] + v[1][0]);
  const int sum_y = middle_difference(v[2][1] + v[0][1]);
  const int dxy = middle_difference(v[2][2] - v[2][0] - v[0][2] + v[0][0]);
  Quadratic q;
  q.value = static_cast<float>(centre.of[1]);
  q.gx = 0.5f * static_cast<float>(dx.of[1]);
  q.gy = 0.5f * static_cast<float>(dy.of[1]);
  q.gs = 0.5f * static_cast<float>(centre.of[2] - centre.of[0]);
  q.hxx = static_cast<float>(sum_x - 2 * centre.of[1]);
  q.hyy = static_cast<float>(sum_y - 2 * centre.of[1]);
  q.hss = static_cast<float>(centre.of[2] + centre.of[0] - 2 * centre.of[1]);
  q.hxy = 0.25f * static_cast<float>(dxy);
  q.hxs = 0.25f * static_cast<float>(dx.of[2] - dx.of[0]);
  q.hys = 0.25f * static_cast<float>(dy.of[2] - dy.of[0]);
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

// By a warp, kLanesPerPoint lanes to a point, all of those alike. Lanes stay together whatever becomes of their point.
__device__ bool Refine(const OctaveLayout& octave, const PlaneValue* planes, float contrast_threshold,
                       float edge_threshold, bool is_point, int x, int y, int level, ScaleSpacePoint* point,
                       int* settled_level, bool* is_dark) {
  const PlaneValue* my_planes = planes + octave.first_value + threadIdx.x % kLanesPerPoint * octave.plane_size;
  Quadratic q;
  float dx = 0.0f;
  float dy = 0.0f;
  float ds = 0.0f;
  bool is_moving = is_point;
  bool has_settled = false;
  for (int step = 0; step < kMaxRefinementSteps && __any_sync(0xffffffffu, is_moving); ++step) {
    // Of points that do not move any more, the same again.
    q = FitQuadratic(my_planes + static_cast<std::size_t>(level - 1) * octave.plane_size +
                         static_cast<std::size_t>(y) * octave.stride + x,
                     octave.stride);
    const bool is_regular = SolveOffset(q, &dx, &dy, &ds);
    if (!is_moving) continue;
    has_settled = is_regular && fabsf(dx) < 0.5f && fabsf(dy) < 0.5f && fabsf(ds) < 0.5f;
    // Far away: the quadratic says nothing about this neighbourhood. (Written so that NaN is far, too.)
    is_moving = is_regular && !has_settled && fabsf(dx) < 8.0f && fabsf(dy) < 8.0f && fabsf(ds) < 8.0f;
    if (!is_moving) continue;
    const int next_x = x + static_cast<int>(roundf(dx));
    const int next_y = y + static_cast<int>(roundf(dy));
    const int next_level = level + static_cast<int>(roundf(ds));
    is_moving = next_level >= 1 && next_level <= kScalesPerOctave && next_x >= kEdgeMarginPx &&
                next_x < octave.width - kEdgeMarginPx && next_y >= kEdgeMarginPx &&
                next_y < octave.height - kEdgeMarginPx;
    if (!is_moving) continue;
    x = next_x;
    y = next_y;
    level = next_level;
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
  *is_dark = q.value > 0.0f;
  return true;
}

constexpr int kRefineThreads = 128;
constexpr int kPointsPerBlock = kRefineThreads / kLanesPerPoint;
constexpr int kRefineBlocks = 132 * 8;

__global__ void __launch_bounds__(kRefineThreads)
    RefineKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractSettings settings,
                 const __grid_constant__ ExtractBuffers buffers) {
  WaitForKernelBefore();
  const int num_extrema = buffers.counters->num_extrema;
  // All lanes of a warp stay in the loop together.
  for (int first = blockIdx.x * kPointsPerBlock + threadIdx.x / 32 * (32 / kLanesPerPoint); first < num_extrema;
       first += gridDim.x * kPointsPerBlock) {
    __syncwarp();
    const int i = first + threadIdx.x % 32 / kLanesPerPoint;
    const uint2 extremum = buffers.extrema[min(i, num_extrema - 1)];
    const int x = extremum.x & 0xffff;
    const int y = extremum.x >> 16;
    const int level = extremum.y & 0xff;
    const int slot = extremum.y >> 8;
    const OctaveLayout& octave = layout.octaves[slot];
    ScaleSpacePoint point;
    int settled_level = 0;
    bool is_dark = false;
    if (!Refine(octave, buffers.planes, settings.contrast_threshold, settings.edge_threshold, i < num_extrema, x, y,
                level, &point, &settled_level, &is_dark)) {
      continue;
    }
    if (threadIdx.x % kLanesPerPoint != 0) continue;
    const bool was_excluded =
        IsExcluded(layout, buffers.dilated_bits, slot, static_cast<float>(x), static_cast<float>(y));
    const bool is_excluded = IsExcluded(layout, buffers.dilated_bits, slot, point.x, point.y);
    if (was_excluded || is_excluded) continue;
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
    const bool is_upright = is_dark && settings.upright_dark != 0;
    buffers.keys[index] = {tie, static_cast<std::uint8_t>(slot), static_cast<std::uint8_t>(settled_level), 0,
                           static_cast<std::uint8_t>(is_upright)};
    const float priority = octave.octave < 0 ? kFinestOctavePriority * point.response : point.response;
    buffers.cell_points[static_cast<std::size_t>(cell) * kMaxPointsPerCell + place] = {priority, tie, index, 0};
  }
}

}  // namespace

cudaError_t LaunchRefinement(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                             const ExtractBuffers& buffers, cudaStream_t stream) {
  RefineKernel<<<kRefineBlocks, kRefineThreads, 0, stream>>>(layout, settings, buffers);
  return cudaGetLastError();
}

}  // namespace haustra::kernels::cuda
