// The passes of a pose fit over its observations, several of them at a time: one table of functions for each
// instruction set. A table is repeatable to the bit; tables differ from each other by rounding. Plain arrays in and
// out, because the files behind it are compiled for one processor and must not leave inline functions behind.
// reentrant, rt-safe. Private to engine/optim and its tests.
#pragma once

#include <cstdint>

#include "engine/optim/vector_level.h"
#include "hal/projection_constants.h"

namespace haustra::optim {

// Of an observation: the point in the world x, y, z, any number, its pixel u, v, its sigma, any number.
inline constexpr int kPoseObservationNumbers = 8;

// Borrowed.
struct PoseView {
  ProjectionConstants camera;
  const double* observations = nullptr;
  const std::uint8_t* used = nullptr;  // one entry an observation, 0: it counts for nothing; nullptr: all count
  int num = 0;
  double robust_scale2 = 0.0;  // of Geman and McClure's cost (small_least_squares.h); 0: plain squares
};

// Normal equations of the left perturbation (rho, phi) of the pose: the lower triangle of the Hessian by rows, the
// gradient, and any number.
struct PoseNormals {
  enum Number { kHessian = 0, kGradient = 21, kNumbers = 28 };
  double numbers[kNumbers];
};

// `pose`: rows of [R | t] of cam_from_world, 12 numbers.
struct PoseKernels {
  // Cost of the observations in use, and their normal equations. An observation that cannot be seen is no part of
  // these; it costs what the robust cost levels off at, infinity where squares are plain.
  double (*Linearise)(const PoseView& view, const double* pose, PoseNormals* normals);
  // Squared errors in sigmas of the observations [begin, end), infinite where one cannot be seen. Writes up to
  // kMaxVectorLanes - 1 numbers beyond the end.
  void (*Errors)(const PoseView& view, const double* pose, int begin, int end, double* chi2);
};

const PoseKernels& PoseKernelsFor(VectorLevel level);

}  // namespace haustra::optim
