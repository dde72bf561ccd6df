// The search of engine/surface/depth_matcher.cc, eight threads to a cell: each takes a source or two, and its window
// sample by sample in the order of the host. Costs and planes are in single precision.
#include <cstdint>

#include "hal/depth_search.h"
#include "kernels/cuda/depth_kernels.h"

namespace haustra::kernels::cuda {
namespace {

using depth_search::kGlare, depth_search::kMinWindowWeight, depth_search::kNoCost;
using depth_search::kNumNearNeighbours, depth_search::kNumNeighbours;
constexpr auto kFirstDepthStep = static_cast<float>(depth_search::kFirstDepthStep);
constexpr auto kFirstSlantStep = static_cast<float>(depth_search::kFirstSlantStep);
constexpr auto kSeedPull = static_cast<float>(depth_search::kSeedPull);
constexpr auto kSeedReach = static_cast<float>(depth_search::kSeedReach);
constexpr auto kSharpPeak = static_cast<float>(depth_search::kSharpPeak);
constexpr auto kMinSlantSine = static_cast<float>(depth_search::kMinSlantSine);

constexpr int kLanes = 8;  // of a cell
constexpr int kCells = 16;
constexpr int kThreads = kLanes * kCells;
constexpr float kNotSeen = 1e30f;

__device__ __forceinline__ float3 Xyz(float4 v) { return make_float3(v.x, v.y, v.z); }
__device__ __forceinline__ float Dot(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
__device__ __forceinline__ float3 Along(float3 a, float t, float3 b) {
  return make_float3(a.x + t * b.x, a.y + t * b.y, a.z + t * b.z);
}
__device__ __forceinline__ float3 Turned(const float* r, float3 v) {
  return make_float3(r[0] * v.x + r[1] * v.y + r[2] * v.z, r[3] * v.x + r[4] * v.y + r[5] * v.z,
                     r[6] * v.x + r[7] * v.y + r[8] * v.z);
}

// The lanes of this thread's cell.
__device__ __forceinline__ unsigned CellMask() { return 0xffu << (threadIdx.x % 32 & ~(kLanes - 1)); }

struct Projected {
  float x, y;     // pixel
  float3 dx, dy;  // of x and of y by the point
};

// Radius in the distorted plane of the fisheye models, and its derivative.
__device__ float RadiusOfAngle(const DepthCamera& camera, float angle, float* derivative) {
  const float* k = camera.coefficients;
  if (camera.kind == static_cast<int>(CameraModelKind::kKannalaBrandt)) {
    const float a2 = angle * angle;
    *derivative = 1.0f + a2 * (3.0f * k[0] + a2 * (5.0f * k[1] + a2 * (7.0f * k[2] + a2 * (9.0f * k[3]))));
    return angle * (1.0f + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
  }
  const float position = fmaxf(0.0f, angle * camera.table_intervals_per_unit);
  const int i = min(static_cast<int>(position), camera.num_table_intervals - 1);
  const float low = camera.inverse_table[i];
  float radius = low + (position - static_cast<float>(i)) * (camera.inverse_table[i + 1] - low);
  float sine, cosine, depth = 0.0f, slope = 0.0f;
  sincosf(angle, &sine, &cosine);
  for (int step = 0; step <= 2; ++step) {
    depth = k[0] + radius * radius * (k[1] + radius * (k[2] + radius * k[3]));
    slope = radius * (2.0f * k[1] + radius * (3.0f * k[2] + radius * 4.0f * k[3]));
    if (step < 2) radius -= (depth * sine - radius * cosine) / (slope * sine - cosine);
  }
  *derivative = (depth * cosine + radius * sine) / (cosine - slope * sine);
  return radius;
}

// CameraModel::Project.
__device__ bool Project(const DepthCamera& camera, float3 p, Projected* out) {
  const float* k = camera.coefficients;
  const float rho2 = p.x * p.x + p.y * p.y, rho = sqrtf(rho2);
  float u, v, uu, uv, vv, uz, vz;
  if (camera.kind == static_cast<int>(CameraModelKind::kPinhole)) {
    if (!(p.z > 0.0f) || !(rho <= p.z * camera.max_tangent)) return false;
    const float inverse_z = 1.0f / p.z, mx = p.x * inverse_z, my = p.y * inverse_z;
    const float r2 = mx * mx + my * my, p1 = k[2], p2 = k[3];
    const float radial = 1.0f + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const float slope = 2.0f * (k[0] + r2 * (2.0f * k[1] + r2 * 3.0f * k[4]));
    u = mx * radial + 2.0f * p1 * mx * my + p2 * (r2 + 2.0f * mx * mx);
    v = my * radial + p1 * (r2 + 2.0f * my * my) + 2.0f * p2 * mx * my;
    uu = (radial + slope * mx * mx + 2.0f * p1 * my + 6.0f * p2 * mx) * inverse_z;
    uv = (slope * mx * my + 2.0f * (p1 * mx + p2 * my)) * inverse_z;
    vv = (radial + slope * my * my + 6.0f * p1 * my + 2.0f * p2 * mx) * inverse_z;
    uz = -(uu * mx + uv * my);
    vz = -(uv * mx + vv * my);
  } else {
    const bool is_on_axis = rho < 1e-5f * fabsf(p.z) || rho == 0.0f;
    if (is_on_axis && !(p.z > 0.0f)) return false;
    const float angle = is_on_axis ? 0.0f : atan2f(rho, p.z);
    if (!(angle <= camera.max_half_angle_rad)) return false;
    float slope;
    const float radius = RadiusOfAngle(camera, angle, &slope);
    const float inverse_d2 = 1.0f / (rho2 + p.z * p.z);
    // Along the radius the curve's slope counts, across it the ratio radius / rho.
    const float along = slope * p.z * inverse_d2;
    const float scale = is_on_axis ? along : radius / rho;
    const float bend = is_on_axis ? 0.0f : (along - scale) / rho2;
    u = scale * p.x;
    v = scale * p.y;
    uu = scale + bend * p.x * p.x;
    uv = bend * p.x * p.y;
    vv = scale + bend * p.y * p.y;
    uz = -slope * inverse_d2 * p.x;
    vz = -slope * inverse_d2 * p.y;
  }
  const float* a = camera.pixel_from_distorted;
  out->x = camera.cx + a[0] * u + a[1] * v;
  out->y = camera.cy + a[2] * u + a[3] * v;
  out->dx = make_float3(a[0] * uu + a[1] * uv, a[0] * uv + a[1] * vv, a[0] * uz + a[1] * vz);
  out->dy = make_float3(a[2] * uu + a[3] * uv, a[2] * uv + a[3] * vv, a[2] * uz + a[3] * vz);
  return true;
}

// As on the host, to 24 bits.
__device__ float Noise(int cell, int iteration, int which) {
  std::uint64_t z = (static_cast<std::uint64_t>(cell) << 20) + static_cast<std::uint64_t>(iteration * 16 + which);
  z = (z + 1) * 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  z ^= z >> 31;
  return static_cast<float>(z >> 40) * (2.0f / 16777216.0f) - 1.0f;
}

// What the threads of a cell know of it. Window in shared memory.
struct Cell {
  int index;
  int x, y;
  float3 bearing, bearing_dx, bearing_dy;
  float variance;
  const float* weight;
  const float* pattern;
};

// The cost in one source; kNotSeen where it does not show the window.
__device__ float SourceCost(const DepthTask& task, const Cell& cell, float3 plane, const DepthSourceView& source) {
  const float inverse_range = Dot(plane, cell.bearing);
  const float3 translation = make_float3(source.translation[0], source.translation[1], source.translation[2]);
  const float3 turned = Turned(source.rotation, cell.bearing);
  const float3 ray = Along(turned, inverse_range, translation);
  if (Dot(turned, ray) > task.max_cosine * sqrtf(Dot(ray, ray))) return kNotSeen;
  Projected at;
  if (!Project(task.camera, ray, &at)) return kNotSeen;
  const int width = task.image_width, height = task.image_height;
  if (!(at.x >= 0.0f && at.y >= 0.0f && at.x < width - 1 && at.y < height - 1)) return kNotSeen;
  if (task.is_scene[static_cast<int>(at.y) * width + static_cast<int>(at.x)] == 0) return kNotSeen;
  const float3 by_x = Along(Turned(source.rotation, cell.bearing_dx), Dot(plane, cell.bearing_dx), translation);
  const float3 by_y = Along(Turned(source.rotation, cell.bearing_dy), Dot(plane, cell.bearing_dy), translation);
  const int radius = task.window_radius;
  const auto step = static_cast<float>(task.window_step_px);
  const float ux = Dot(at.dx, by_x) * step, uy = Dot(at.dy, by_x) * step;
  const float vx = Dot(at.dx, by_y) * step, vy = Dot(at.dy, by_y) * step;
  const float reach_x = radius * (fabsf(ux) + fabsf(vx)), reach_y = radius * (fabsf(uy) + fabsf(vy));
  if (!(at.x - reach_x >= 0.0f && at.y - reach_y >= 0.0f && at.x + reach_x < width - 1 &&
        at.y + reach_y < height - 1)) {
    return kNotSeen;
  }
  float sum = 0.0f, squares = 0.0f, product = 0.0f;
  int k = 0;
  for (int v = -radius; v <= radius; ++v) {
    for (int u = -radius; u <= radius; ++u, ++k) {
      const float x = at.x + static_cast<float>(u) * ux + static_cast<float>(v) * vx;
      const float y = at.y + static_cast<float>(u) * uy + static_cast<float>(v) * vy;
      const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
      const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
      // Rounding may carry a corner of the window to the last row or column: there the quad has the edge twice.
      const std::uint32_t quad = __ldg(&source.quads[y0 * width + x0]);
      const auto p00 = static_cast<float>(quad & 0xff), p10 = static_cast<float>((quad >> 8) & 0xff);
      const auto p01 = static_cast<float>((quad >> 16) & 0xff), p11 = static_cast<float>(quad >> 24);
      const float above = p00 + fx * (p10 - p00), below = p01 + fx * (p11 - p01);
      const float value = above + fy * (below - above);
      const float weight = cell.weight[k];
      sum += weight * value;
      squares += weight * value * value;
      product += cell.pattern[k] * value;
    }
  }
  const float variance = fmaxf(squares - sum * sum, 0.0f);
  return 1.0f - product * rsqrtf((variance + task.noise_variance) * (cell.variance + task.noise_variance));
}

__device__ __forceinline__ float CellMin(float value) {
  const unsigned mask = CellMask();
#pragma unroll
  for (int step = kLanes / 2; step > 0; step /= 2) value = fminf(value, __shfl_xor_sync(mask, value, step));
  return value;
}

// The same bits in all lanes: two of them add the same two numbers in every step.
__device__ __forceinline__ float CellSum(float value) {
  const unsigned mask = CellMask();
#pragma unroll
  for (int step = kLanes / 2; step > 0; step /= 2) value += __shfl_xor_sync(mask, value, step);
  return value;
}

// Mean over the sources that match best, the same in all lanes of the cell.
__device__ float DataCost(const DepthTask& task, const Cell& cell, float3 plane) {
  if (cell.variance < 0.0f) return kNoCost;
  const int lane = threadIdx.x % kLanes;
  float first = lane < task.num_sources ? SourceCost(task, cell, plane, task.sources[lane]) : kNotSeen;
  float second =
      lane + kLanes < task.num_sources ? SourceCost(task, cell, plane, task.sources[lane + kLanes]) : kNotSeen;
  float sum = 0.0f;
  int count = 0;
  for (; count < task.best_sources; ++count) {
    const float least = CellMin(fminf(first, second));
    if (least >= kNotSeen) break;
    sum += least;
    // Of equal ones, one is taken.
    const unsigned mask = CellMask();
    const unsigned holders = __ballot_sync(mask, fminf(first, second) == least) & mask;
    if (static_cast<int>(threadIdx.x % 32) == __ffs(static_cast<int>(holders)) - 1) {
      (first == least ? first : second) = kNotSeen;
    }
  }
  return count == 0 ? kNoCost : sum / static_cast<float>(count);
}

__device__ bool IsPossible(const DepthTask& task, const Cell& cell, float3 plane) {
  const float inverse_range = Dot(plane, cell.bearing);
  if (!(inverse_range >= task.min_inverse_range && inverse_range <= task.max_inverse_range)) return false;
  return inverse_range > kMinSlantSine * sqrtf(Dot(plane, plane));
}

// By distance, then left, right, up, down; -1: there is no usable cell.
__device__ int NeighbourOf(const DepthTask& task, const Cell& cell, int which) {
  const int distance = which < 4 ? 1 : which < 8 ? 3 : which < 12 ? 5 : 9, side = which % 4;
  const int x = cell.x + (side == 0 ? -distance : side == 1 ? distance : 0);
  const int y = cell.y + (side == 2 ? -distance : side == 3 ? distance : 0);
  if (x < 0 || y < 0 || x >= task.width || y >= task.height) return -1;
  const int neighbour = y * task.width + x;
  return task.bearing[neighbour].w != 0.0f ? neighbour : -1;
}

// Every lane of the cell takes a share of the neighbours; all have the same result.
__device__ float SmoothCost(const DepthTask& task, const Cell& cell, float3 plane) {
  const float inverse_range = Dot(plane, cell.bearing);
  const float scale = 1.0f / (task.smooth_step * inverse_range);
  float sum = 0.0f, count = 0.0f;
  for (int k = threadIdx.x % kLanes; k < kNumNeighbours; k += kLanes) {
    const int neighbour = NeighbourOf(task, cell, k);
    if (neighbour < 0) continue;
    sum += fminf(fabsf(Dot(Xyz(task.estimates[neighbour]), cell.bearing) - inverse_range) * scale, 1.0f);
    count += 1.0f;
  }
  sum = CellSum(sum);
  count = CellSum(count);
  const float from_seed =
      fabsf(Dot(Xyz(task.first[cell.index]), cell.bearing) - inverse_range) / (kSeedReach * inverse_range);
  return task.smoothness * sum / fmaxf(count, 1.0f) + kSeedPull * fminf(from_seed, 1.0f);
}

struct Best {
  float3 plane;
  float data;
  float cost;
};

__device__ void Consider(const DepthTask& task, const Cell& cell, float3 plane, Best* best) {
  if (!IsPossible(task, cell, plane)) return;
  const float smooth = SmoothCost(task, cell, plane);
  if (smooth >= best->cost) return;  // a correlation costs nothing at the least
  const float data = DataCost(task, cell, plane);
  if (data + smooth >= best->cost) return;
  *best = {plane, data, data + smooth};
}

// Of each cell its window in shared memory; all threads of the block call it. False: this thread has no cell, or one
// that is not usable.
__device__ bool LoadCell(const DepthTask& task, int index, bool is_there, Cell* cell) {
  extern __shared__ float windows[];
  const int side = 2 * task.window_radius + 1, num_samples = side * side;
  const int slot = threadIdx.x / kLanes, lane = threadIdx.x % kLanes;
  float* weight = windows + slot * 2 * num_samples;
  float* pattern = weight + num_samples;
  is_there = is_there && task.bearing[index].w != 0.0f;
  if (is_there) {
    const std::ptrdiff_t from = static_cast<std::ptrdiff_t>(index) * num_samples;
    for (int k = lane; k < num_samples; k += kLanes) {
      weight[k] = task.weight[from + k];
      pattern[k] = task.pattern[from + k];
    }
  }
  __syncthreads();
  if (!is_there) return false;
  cell->index = index;
  cell->x = index % task.width;
  cell->y = index / task.width;
  cell->bearing = Xyz(task.bearing[index]);
  cell->bearing_dx = Xyz(task.bearing_dx[index]);
  cell->bearing_dy = Xyz(task.bearing_dy[index]);
  cell->variance = task.variance[index];
  cell->weight = weight;
  cell->pattern = pattern;
  return true;
}

__global__ void PackQuadsKernel(const std::uint8_t* grey, int width, int height, std::uint32_t* quads) {
  const int x = blockIdx.x * blockDim.x + threadIdx.x, y = blockIdx.y;
  if (x >= width) return;
  const int right = min(x + 1, width - 1);
  const std::uint8_t* row = grey + static_cast<std::ptrdiff_t>(y) * width;
  const std::uint8_t* below = grey + static_cast<std::ptrdiff_t>(min(y + 1, height - 1)) * width;
  quads[static_cast<std::ptrdiff_t>(y) * width + x] =
      row[x] | row[right] << 8 | below[x] << 16 | static_cast<std::uint32_t>(below[right]) << 24;
}

// DepthMatcher::PrepareWindows, a thread a cell.
__global__ void WindowsKernel(DepthTask task) {
  const int index = blockIdx.x * blockDim.x + threadIdx.x;
  if (index >= task.width * task.height || task.bearing[index].w == 0.0f) return;
  const int radius = task.window_radius, step = task.window_step_px;
  const int side = 2 * radius + 1, num_samples = side * side;
  const float sigma_px = static_cast<float>(radius * step) * 0.75f;
  const float centre_x = task.bearing_dx[index].w, centre_y = task.bearing_dy[index].w;
  float* weight = task.weight + static_cast<std::ptrdiff_t>(index) * num_samples;
  float* pattern = task.pattern + static_cast<std::ptrdiff_t>(index) * num_samples;
  float sum = 0.0f, full = 0.0f, mean = 0.0f;
  int k = 0;
  for (int v = -radius; v <= radius; ++v) {
    for (int u = -radius; u <= radius; ++u, ++k) {
      const float x = centre_x + static_cast<float>(u * step), y = centre_y + static_cast<float>(v * step);
      const int x0 = static_cast<int>(floorf(x)), y0 = static_cast<int>(floorf(y));
      const float spatial = expf(-static_cast<float>((u * u + v * v) * step * step) / (2.0f * sigma_px * sigma_px));
      full += spatial;
      weight[k] = 0.0f;
      pattern[k] = 0.0f;
      if (x0 < 0 || y0 < 0 || x0 + 1 >= task.image_width || y0 + 1 >= task.image_height) continue;
      const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
      const std::uint8_t* row = task.reference + static_cast<std::ptrdiff_t>(y0) * task.image_width + x0;
      const std::uint8_t* below = row + task.image_width;
      if (max(max(row[0], row[1]), max(below[0], below[1])) >= kGlare) continue;
      if (task.is_scene[static_cast<std::ptrdiff_t>(y0) * task.image_width + x0] == 0) continue;
      weight[k] = spatial;
      pattern[k] = (1.0f - fy) * ((1.0f - fx) * row[0] + fx * row[1]) + fy * ((1.0f - fx) * below[0] + fx * below[1]);
      sum += spatial;
      mean += spatial * pattern[k];
    }
  }
  task.variance[index] = -1.0f;
  if (sum < kMinWindowWeight * full) return;
  mean /= sum;
  float variance = 0.0f;
  for (k = 0; k < num_samples; ++k) {
    weight[k] /= sum;
    const float deviation = weight[k] > 0.0f ? pattern[k] - mean : 0.0f;
    pattern[k] = weight[k] * deviation;
    variance += pattern[k] * deviation;
  }
  task.variance[index] = variance;
}

__global__ void BeginKernel(DepthTask task) {
  const int index = blockIdx.x * kCells + threadIdx.x / kLanes;
  Cell cell;
  if (!LoadCell(task, index, index < task.width * task.height, &cell)) return;
  const float3 plane = Xyz(task.first[index]);
  const float data = DataCost(task, cell, plane);
  if (threadIdx.x % kLanes == 0) task.estimates[index] = make_float4(plane.x, plane.y, plane.z, data);
}

__global__ void __launch_bounds__(kThreads) ImproveKernel(DepthTask task, int iteration, int colour) {
  const int columns = (task.width + 1) / 2;
  const int number = blockIdx.x * kCells + threadIdx.x / kLanes;
  const int row = number / columns;
  const int column = 2 * (number % columns) + (row + colour) % 2;
  const int index = row * task.width + column;
  Cell cell;
  if (!LoadCell(task, index, row < task.height && column < task.width, &cell)) return;
  const float4 before = task.estimates[index];
  Best best{Xyz(before), before.w, before.w + SmoothCost(task, cell, Xyz(before))};
  // Cells of the other colour: none of them changes meanwhile.
  const int num_neighbours = iteration > 1 ? kNumNearNeighbours : kNumNeighbours;
  for (int k = 0; k < num_neighbours; ++k) {
    const int neighbour = NeighbourOf(task, cell, k);
    if (neighbour >= 0) Consider(task, cell, Xyz(task.estimates[neighbour]), &best);
  }
  if (iteration == 0) Consider(task, cell, Xyz(task.first[index]), &best);
  const float shrink = ldexpf(1.0f, -iteration);
  for (int trial = 0; trial < 4; ++trial) {
    const float inverse_range = Dot(best.plane, cell.bearing);
    float3 across = Along(best.plane, -inverse_range, cell.bearing);
    float along = inverse_range;
    const float size = shrink * (trial == 3 ? 0.25f : 1.0f);
    if (trial != 1) along *= 1.0f + kFirstDepthStep * size * Noise(index, iteration, trial * 4);
    if (trial != 0) {
      const float3 turn = make_float3(Noise(index, iteration, trial * 4 + 1), Noise(index, iteration, trial * 4 + 2),
                                      Noise(index, iteration, trial * 4 + 3));
      const float3 tangent = Along(turn, -Dot(turn, cell.bearing), cell.bearing);
      across = Along(across, kFirstSlantStep * size * inverse_range, tangent);
    }
    Consider(task, cell, Along(across, along, cell.bearing), &best);
  }
  if (threadIdx.x % kLanes == 0) {
    task.estimates[index] = make_float4(best.plane.x, best.plane.y, best.plane.z, best.data);
  }
}

// Relative step of the range that moves the picture in the source with most parallax by one pixel; 0: no parallax.
__device__ float StepOfOnePixel(const DepthTask& task, const Cell& cell, float3 plane) {
  const float inverse_range = Dot(plane, cell.bearing);
  float most = 0.0f;
  for (int s = threadIdx.x % kLanes; s < task.num_sources; s += kLanes) {
    const DepthSourceView& source = task.sources[s];
    const float3 translation = make_float3(source.translation[0], source.translation[1], source.translation[2]);
    const float3 ray = Along(Turned(source.rotation, cell.bearing), inverse_range, translation);
    Projected at;
    if (!Project(task.camera, ray, &at)) continue;
    if (!(at.x >= 0.0f && at.y >= 0.0f && at.x <= task.image_width - 1 && at.y <= task.image_height - 1)) continue;
    // d pixel / d log range.
    const float dx = Dot(at.dx, translation) * inverse_range, dy = Dot(at.dy, translation) * inverse_range;
    most = fmaxf(most, sqrtf(dx * dx + dy * dy));
  }
  most = -CellMin(-most);
  return most > 1.0f ? 1.0f / most : 0.0f;
}

__global__ void AnswerKernel(DepthTask task) {
  const int index = blockIdx.x * kCells + threadIdx.x / kLanes;
  const bool is_first = threadIdx.x % kLanes == 0;
  const bool is_there = index < task.width * task.height;
  Cell cell;
  float answer = 0.0f;
  int confidence = 0;
  if (LoadCell(task, index, is_there, &cell)) {
    const float4 estimate = task.estimates[index];
    const float3 plane = Xyz(estimate);
    const float step = estimate.w < kNoCost ? StepOfOnePixel(task, cell, plane) : 0.0f;
    if (step > 0.0f) {
      const float inverse_range = Dot(plane, cell.bearing);
      const auto cost_at = [&](float pixels) {
        return DataCost(task, cell, Along(plane, inverse_range * pixels * step, cell.bearing));
      };
      const float below = cost_at(-0.5f), above = cost_at(0.5f), middle = estimate.w;
      const float curvature = below + above - 2.0f * middle;
      float shift = 0.0f;
      if (curvature > 1e-6f) shift = fminf(fmaxf(0.25f * (below - above) / curvature, -0.5f), 0.5f);
      const float rise = 0.5f * (cost_at(-1.0f) + cost_at(1.0f)) - middle;
      const float match = fminf(fmaxf(1.0f - middle, 0.0f), 1.0f);
      const float peak = fminf(fmaxf(rise / kSharpPeak, 0.0f), 1.0f);
      answer = inverse_range * (1.0f + shift * step * peak);
      confidence = static_cast<int>(lrintf(1.0f + 254.0f * match * peak));
    }
  }
  if (is_first && is_there) {
    task.inverse_range[index] = answer;
    task.confidence[index] = static_cast<std::uint8_t>(confidence);
  }
}

int BlocksFor(int num, int each) { return (num + each - 1) / each; }

int WindowBytes(const DepthTask& task) {
  const int side = 2 * task.window_radius + 1;
  return kCells * 2 * side * side * static_cast<int>(sizeof(float));
}

}  // namespace

cudaError_t LaunchPackQuads(const std::uint8_t* grey, int width, int height, std::uint32_t* quads,
                            cudaStream_t stream) {
  constexpr int kPackThreads = 128;
  PackQuadsKernel<<<dim3(BlocksFor(width, kPackThreads), height), kPackThreads, 0, stream>>>(grey, width, height,
                                                                                             quads);
  return cudaGetLastError();
}

cudaError_t LaunchDepthWindows(const DepthTask& task, cudaStream_t stream) {
  WindowsKernel<<<BlocksFor(task.width * task.height, 64), 64, 0, stream>>>(task);
  return cudaGetLastError();
}

cudaError_t LaunchDepthBegin(const DepthTask& task, cudaStream_t stream) {
  BeginKernel<<<BlocksFor(task.width * task.height, kCells), kThreads, WindowBytes(task), stream>>>(task);
  return cudaGetLastError();
}

cudaError_t LaunchDepthImprove(const DepthTask& task, int iteration, int colour, cudaStream_t stream) {
  const int num = (task.width + 1) / 2 * task.height;
  ImproveKernel<<<BlocksFor(num, kCells), kThreads, WindowBytes(task), stream>>>(task, iteration, colour);
  return cudaGetLastError();
}

cudaError_t LaunchDepthAnswer(const DepthTask& task, cudaStream_t stream) {
  AnswerKernel<<<BlocksFor(task.width * task.height, kCells), kThreads, WindowBytes(task), stream>>>(task);
  return cudaGetLastError();
}

}  // namespace haustra::kernels::cuda
