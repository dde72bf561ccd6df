// The search for the planes of a depth map, on a device: what engine/surface/depth_matcher.h does for all cells at
// once. Plain data in and out. The engine's own search is the reference; a device rounds differently, and agrees with
// it on nearly all cells (tests/kernels/cuda_depth_solver_test.cc).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "hal/core/status.h"
#include "hal/core/views.h"
#include "hal/depth_options.h"
#include "hal/projection_constants.h"

namespace haustra {

inline constexpr int kMaxDepthSources = 12;

// A cell of the depth map: the ray of its centre and how it changes to the next pixel, camera coordinates, unit length.
struct DepthCell {
  std::array<float, 3> bearing{}, bearing_dx{}, bearing_dy{};
  float centre_x_px = 0.0f, centre_y_px = 0.0f;
  bool is_usable = false;  // the rest is anything otherwise
};

// What a solver is made for. Spans, mask and the camera's table need to live during the call only.
struct DepthSolverPlan {
  ProjectionConstants camera;
  int width_px = 0, height_px = 0;  // of all pictures
  int width = 0, height = 0;        // of the depth map, in cells
  DepthOptions options;
  std::span<const DepthCell> cells;        // width * height, by rows
  std::span<const std::uint8_t> is_scene;  // width_px * height_px, by rows: 0 where pictures show no scene
};

// Not owning. kGrey8 in host memory, of the planned size.
struct DepthSource {
  ImageView grey;
  std::array<float, 9> rotation{};     // source_from_reference, by rows
  std::array<float, 3> translation{};  // map units
};

struct DepthProblem {
  ImageView reference;
  std::span<const DepthSource> sources;  // 1 to options.max_sources
  // Three numbers a cell: p of the plane p . x = 1 that the search begins with, 1 / map units.
  std::span<const float> first_planes;
  float min_inverse_range = 0.0f, max_inverse_range = 0.0f;  // 1 / map units, of all planes that are tried
};

// thread-bound(its owner). All memory is taken at construction. Solve waits for the device: not for the tracking
// thread.
class DepthSolver {
 public:
  virtual ~DepthSolver() = default;
  // Writes inverse range (0: none) and confidence (0 to 255) of each cell. Same input, same bits on the same device.
  // kInvalidArgument: a size is not the planned one. kUnavailable: the device is gone; the answer is anything then.
  virtual Status Solve(const DepthProblem& problem, std::span<float> inverse_range,
                       std::span<std::uint8_t> confidence) = 0;
};

}  // namespace haustra
