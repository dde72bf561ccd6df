// Kernels of the depth of a keyframe (depth.cu), and what they take.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "hal/depth_solver.h"

namespace haustra::kernels::cuda {

// Of ProjectionConstants, in single precision.
struct DepthCamera {
  int kind = 0;  // CameraModelKind
  float coefficients[5] = {};
  float pixel_from_distorted[4] = {};
  float cx = 0.0f, cy = 0.0f;
  float max_half_angle_rad = 0.0f, max_tangent = 0.0f;
  const float* inverse_table = nullptr;  // device
  float table_intervals_per_unit = 0.0f;
  int num_table_intervals = 0;
};

struct DepthSourceView {
  // A picture whose every word has the four grey values at (x, y), (x + 1, y), (x, y + 1) and (x + 1, y + 1), lowest
  // byte first.
  const std::uint32_t* quads = nullptr;
  float rotation[9] = {};
  float translation[3] = {};
};

// All pointers are to device memory.
struct DepthTask {
  DepthCamera camera;
  int image_width = 0, image_height = 0;
  int width = 0, height = 0;  // cells
  int window_radius = 0, window_step_px = 0;
  int best_sources = 0;
  int num_sources = 0;
  float noise_variance = 0.0f;
  float smoothness = 0.0f, smooth_step = 0.0f;
  float max_cosine = 0.0f;  // of the least parallax
  float min_inverse_range = 0.0f, max_inverse_range = 0.0f;
  const std::uint8_t* is_scene = nullptr;
  const std::uint8_t* reference = nullptr;  // image_width bytes a row
  DepthSourceView sources[kMaxDepthSources];
  // Of the cells. The fourth component: 1 where it is usable; column and row of its centre.
  const float4* bearing = nullptr;
  const float4* bearing_dx = nullptr;
  const float4* bearing_dy = nullptr;
  const float4* first = nullptr;  // planes
  float4* estimates = nullptr;    // planes and the cost of the pictures
  float* weight = nullptr;        // of each sample of a cell's window; all of a cell sum to one
  float* pattern = nullptr;       // weight times deviation from the mean
  float* variance = nullptr;      // of the window; negative: not enough of it is scene
  float* inverse_range = nullptr;
  std::uint8_t* confidence = nullptr;
};

cudaError_t LaunchPackQuads(const std::uint8_t* grey, int width, int height, std::uint32_t* quads, cudaStream_t stream);
cudaError_t LaunchDepthWindows(const DepthTask& task, cudaStream_t stream);
cudaError_t LaunchDepthBegin(const DepthTask& task, cudaStream_t stream);
// One colour of the checkerboard.
cudaError_t LaunchDepthImprove(const DepthTask& task, int iteration, int colour, cudaStream_t stream);
cudaError_t LaunchDepthAnswer(const DepthTask& task, cudaStream_t stream);

}  // namespace haustra::kernels::cuda
