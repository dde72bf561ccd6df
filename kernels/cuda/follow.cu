// Follows features from the last picture by optical flow, a warp to a feature, as kernels/cpu/feature_follower.h does.
#include <cstdint>

#include "kernels/common/flow_parameters.h"
#include "kernels/cuda/descriptor.cuh"
#include "kernels/cuda/exclusion.cuh"
#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kThreads = 128;
constexpr int kWarps = kThreads / 32;
// Pixels of a patch: those of a column and every second row to a lane.
constexpr int kPixelsPerLane = kFlowPatchArea / 32;
static_assert(kFlowPatchPx == 16);
constexpr float kMinVariance = 1.0f;  // of counts (plane_value.cuh): kFlowMinVariance, but for 3 %

struct Level {
  const PlaneValue* values;
  int width, height, stride;
};

struct LanePatch {
  float values[kPixelsPerLane];
};

__device__ __forceinline__ LanePatch SamplePatch(const Level& level, float x, float y) {
  const float left = x - 0.5f * (kFlowPatchPx - 1), top = y - 0.5f * (kFlowPatchPx - 1);
  const int first_x = static_cast<int>(left), first_y = static_cast<int>(top);
  const float u = left - static_cast<float>(first_x), v = top - static_cast<float>(first_y);
  const float a = (1.0f - u) * (1.0f - v), b = u * (1.0f - v), c = (1.0f - u) * v, d = u * v;
  const int lane = threadIdx.x % 32;
  const PlaneValue* at =
      level.values + static_cast<std::ptrdiff_t>(first_y + lane / 16) * level.stride + first_x + lane % 16;
  LanePatch patch;
#pragma unroll
  for (int k = 0; k < kPixelsPerLane; ++k, at += 2 * level.stride) {
    patch.values[k] =
        a * ToCounts(at[0]) + b * ToCounts(at[1]) + c * ToCounts(at[level.stride]) + d * ToCounts(at[level.stride + 1]);
  }
  return patch;
}

// Takes the mean away and divides by the deviation, which is returned.
__device__ float Normalise(LanePatch* patch) {
  float sum = 0.0f, squares = 0.0f;
#pragma unroll
  for (const float value : patch->values) sum += value;
  const float mean = WarpSum(sum) / kFlowPatchArea;
#pragma unroll
  for (float& value : patch->values) {
    value -= mean;
    squares += value * value;
  }
  const float deviation = sqrtf(fmaxf(WarpSum(squares) / kFlowPatchArea, kMinVariance));
  const float factor = 1.0f / deviation;
#pragma unroll
  for (float& value : patch->values) value *= factor;
  return deviation;
}

__device__ __forceinline__ bool IsInsideLevel(const Level& level, float x, float y) {
  return x >= kFlowMarginPx && y >= kFlowMarginPx && x < static_cast<float>(level.width) - 1.0f - kFlowMarginPx &&
         y < static_cast<float>(level.height) - 1.0f - kFlowMarginPx;
}

__device__ LanePatch SampleGradient(const Level& level, float x, float y, float dx, float dy, float deviation) {
  const LanePatch before = SamplePatch(level, x - dx, y - dy);
  LanePatch after = SamplePatch(level, x + dx, y + dy);
  const float factor = 0.5f / deviation;
#pragma unroll
  for (int k = 0; k < kPixelsPerLane; ++k) after.values[k] = (after.values[k] - before.values[k]) * factor;
  return after;
}

__device__ __forceinline__ float Product(const LanePatch& a, const LanePatch& b) {
  float sum = 0.0f;
#pragma unroll
  for (int k = 0; k < kPixelsPerLane; ++k) sum += a.values[k] * b.values[k];
  return WarpSum(sum);
}

// SiftKernels::AlignPatch (kernels/cpu/sift_kernels.h), for a warp with the same result in all lanes.
__device__ float AlignPatch(const Level& before, const Level& now, float x, float y, float* x_now, float* y_now) {
  if (!IsInsideLevel(before, x, y)) return -1.0f;
  LanePatch pattern = SamplePatch(before, x, y);
  const float deviation = Normalise(&pattern);
  const LanePatch along_x = SampleGradient(before, x, y, 1.0f, 0.0f, deviation);
  const LanePatch along_y = SampleGradient(before, x, y, 0.0f, 1.0f, deviation);
  const float hxx = Product(along_x, along_x), hxy = Product(along_x, along_y), hyy = Product(along_y, along_y);
  const float determinant = hxx * hyy - hxy * hxy;
  const float half_trace = 0.5f * (hxx + hyy);
  const float least = half_trace - sqrtf(fmaxf(half_trace * half_trace - determinant, 0.0f));
  if (least < kFlowMinGradient2 * kFlowPatchArea) return -1.0f;
  float correlation = -1.0f;
  for (int step = 0; step < kFlowMaxSteps; ++step) {
    if (!IsInsideLevel(now, *x_now, *y_now)) return -1.0f;
    LanePatch found = SamplePatch(now, *x_now, *y_now);
    Normalise(&found);
    correlation = Product(found, pattern) / kFlowPatchArea;
#pragma unroll
    for (int k = 0; k < kPixelsPerLane; ++k) found.values[k] -= pattern.values[k];
    const float sum_x = Product(along_x, found), sum_y = Product(along_y, found);
    const float dx = (hxy * sum_y - hyy * sum_x) / determinant;
    const float dy = (hxy * sum_x - hxx * sum_y) / determinant;
    const float length2 = dx * dx + dy * dy;
    if (!(length2 < kFlowMaxStepPx * kFlowMaxStepPx)) return -1.0f;
    *x_now += dx;
    *y_now += dy;
    if (length2 < kFlowSettledPx * kFlowSettledPx) break;
  }
  return correlation;
}

struct Levels {
  Level kept[kFlowLevels];
  Level now[kFlowLevels];
  int num;
};

Levels LevelsOf(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers) {
  Levels levels{};
  const PlaneValue* kept = buffers.kept_levels;
  for (int slot = -kFirstOctave; slot < layout.num_octaves && levels.num < kFlowLevels; ++slot, ++levels.num) {
    const OctaveLayout& octave = layout.octaves[slot];
    levels.kept[levels.num] = {kept, octave.width, octave.height, octave.stride};
    levels.now[levels.num] = {buffers.planes + octave.first_value, octave.width, octave.height, octave.stride};
    kept += octave.plane_size;
  }
  return levels;
}

// From coarse to fine; a level that says nothing leaves what the coarser ones have said. The correlation of the finest.
__device__ float FollowThrough(const Level* from, const Level* to, int num, float x, float y, float* x_there,
                               float* y_there) {
  float moved_x = 0.0f, moved_y = 0.0f, correlation = -1.0f;
  for (int level = num - 1; level >= 0; --level) {
    const float to_input = ToInput(level), to_level = ToInput(-level);
    float level_x = (x + moved_x) * to_level, level_y = (y + moved_y) * to_level;
    correlation = AlignPatch(from[level], to[level], x * to_level, y * to_level, &level_x, &level_y);
    if (correlation < 0.0f) continue;
    moved_x = level_x * to_input - x;
    moved_y = level_y * to_input - y;
  }
  *x_there = x + moved_x;
  *y_there = y + moved_y;
  return correlation;
}

// By a warp, with the same result in all lanes.
__device__ bool IsDetected(const Keypoint* detected, int num_detected, const Keypoint& keypoint) {
  const float distance = fmaxf(kFlowSameMinPx, kFlowSameDistance * keypoint.scale_px);
  bool is_near = false;
  for (int i = threadIdx.x % 32; i < num_detected; i += 32) {
    const float dx = detected[i].x_px - keypoint.x_px, dy = detected[i].y_px - keypoint.y_px;
    const float scale = detected[i].scale_px;
    is_near |= dx * dx + dy * dy < distance * distance && scale < kFlowSameScaleFactor * keypoint.scale_px &&
               keypoint.scale_px < kFlowSameScaleFactor * scale;
  }
  return __any_sync(0xffffffffu, is_near);
}

__global__ void __launch_bounds__(kThreads)
    FollowKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                 const __grid_constant__ SetBuffers sets, const __grid_constant__ Levels levels,
                 const __grid_constant__ FollowList list) {
  const int i = kWarps * blockIdx.x + threadIdx.x / 32;
  if (i >= list.num) return;
  Keypoint keypoint = list.features[i];
  const float x = keypoint.x_px, y = keypoint.y_px;
  float back_x = 0.0f, back_y = 0.0f;
  float correlation = FollowThrough(levels.kept, levels.now, levels.num, x, y, &keypoint.x_px, &keypoint.y_px);
  if (correlation >= kFlowMinRoughCorrelation) {
    correlation = fminf(correlation, FollowThrough(levels.now, levels.kept, levels.num, keypoint.x_px, keypoint.y_px,
                                                   &back_x, &back_y));
  }
  const float distance = hypotf(back_x - x, back_y - y);
  const bool is_found = correlation >= kFlowMinRoughCorrelation && distance <= kFlowMaxRoughReturnPx;
  const bool is_sure = correlation >= kFlowMinCorrelation && distance <= kFlowMaxReturnPx;
  bool is_new = is_sure && i >= list.num_only_followed;
  if (is_new) {
    const int slot = keypoint.octave - kFirstOctave;
    const OctaveLayout& octave = layout.octaves[slot];
    const float to_octave = ToInput(-keypoint.octave);
    const float octave_x = keypoint.x_px * to_octave, octave_y = keypoint.y_px * to_octave;
    const std::size_t row = static_cast<std::size_t>(buffers.params->set_index) * sets.max_features;
    is_new = octave_x >= kEdgeMarginPx && octave_y >= kEdgeMarginPx &&
             octave_x < static_cast<float>(octave.width - kEdgeMarginPx) &&
             octave_y < static_cast<float>(octave.height - kEdgeMarginPx) &&
             !IsExcluded(layout, buffers.dilated_bits, slot, octave_x, octave_y) &&
             !IsDetected(sets.keypoints + row, buffers.counters->num_detected, keypoint);
  }
  if (threadIdx.x % 32 != 0) return;
  list.to[i] = {keypoint.x_px, keypoint.y_px, is_found, is_sure};
  buffers.followed[i] = {keypoint.x_px, keypoint.y_px, is_new ? 1 : 0};
}

// How many of the first `num` are new, by a warp.
__device__ int CountNew(const FollowedFeature* followed, int num) {
  int count = 0;
  for (int i = threadIdx.x % 32; i < num; i += 32) count += followed[i].is_new;
  return __reduce_add_sync(0xffffffffu, count);
}

// Of the octave at `scale`, the level of a keypoint's descriptor (LevelOfScale in kernels/common/gaussian_kernel.h).
__device__ __forceinline__ int DescriptorLevel(float scale) {
  const int level = static_cast<int>(roundf(kScalesPerOctave * log2f(scale / kBaseSigma)));
  return min(max(level, 1), kScalesPerOctave) + kDescriptorLevelOffset;
}

__global__ void __launch_bounds__(kThreads)
    AddFollowedKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                      const __grid_constant__ SetBuffers sets, const __grid_constant__ FrameOutput output,
                      const __grid_constant__ FollowList list, int root_sift, std::uint32_t number) {
  __shared__ alignas(16) std::int32_t histograms[kWarps][kDescriptorBytes];
  const int warp = threadIdx.x / 32;
  const int i = kWarps * blockIdx.x + warp;
  const int num_detected = buffers.counters->num_detected;
  if (i < list.num && buffers.followed[i].is_new != 0) {
    const int place = num_detected + CountNew(buffers.followed, i);
    if (place < sets.max_features) {
      Keypoint keypoint = list.features[i];
      keypoint.x_px = buffers.followed[i].x_px;
      keypoint.y_px = buffers.followed[i].y_px;
      const float to_octave = ToInput(-keypoint.octave);
      const OctaveLayout& octave = layout.octaves[keypoint.octave - kFirstOctave];
      const ScaleSpacePoint point = {keypoint.x_px * to_octave, keypoint.y_px * to_octave,
                                     keypoint.scale_px * to_octave, keypoint.response};
      const std::size_t row = static_cast<std::size_t>(buffers.params->set_index) * sets.max_features + place;
      if (threadIdx.x % 32 == 0) sets.keypoints[row] = output.keypoints[place] = keypoint;
      const PlaneValue* level = buffers.planes + octave.first_value + DescriptorLevel(point.scale) * octave.plane_size;
      WriteDescriptor(sets, row, Describe(level, octave, point, keypoint.angle_rad, root_sift, histograms[warp]));
    }
  }
  if (!IsLastPart(&buffers.counters->num_followed, gridDim.x) || warp != 0) return;
  const int num_new = CountNew(buffers.followed, list.num);
  if (threadIdx.x != 0) return;
  *output.num_features = min(num_detected + num_new, sets.max_features);
  *output.num_detected = num_detected;
  asm volatile("st.release.sys.u32 [%0], %1;" ::"l"(&output.done->number), "r"(number) : "memory");
}

}  // namespace

cudaError_t KeepLevels(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, cudaStream_t stream) {
  const Levels levels = LevelsOf(layout, buffers);
  cudaError_t error = cudaSuccess;
  for (int i = 0; i < levels.num && error == cudaSuccess; ++i) {
    const std::size_t num_bytes = layout.octaves[i - kFirstOctave].plane_size * sizeof(PlaneValue);
    error = cudaMemcpyAsync(const_cast<PlaneValue*>(levels.kept[i].values), levels.now[i].values, num_bytes,
                            cudaMemcpyDeviceToDevice, stream);
  }
  return error;
}

cudaError_t LaunchFollow(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                         const SetBuffers& sets, const FrameOutput& output, const FollowList& list,
                         std::uint32_t number, cudaStream_t stream) {
  const int num_blocks = (list.num + kWarps - 1) / kWarps;
  const cudaError_t error = LaunchAfter(false, FollowKernel, num_blocks, kThreads, 0, stream, layout, buffers, sets,
                                        LevelsOf(layout, buffers), list);
  if (error != cudaSuccess) return error;
  return LaunchAfter(false, AddFollowedKernel, num_blocks, kThreads, 0, stream, layout, buffers, sets, output, list,
                     settings.root_sift, number);
}

}  // namespace haustra::kernels::cuda
