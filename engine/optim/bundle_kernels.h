// The two passes of bundle adjustment over the observations, several of them at a time: one table of functions for each
// instruction set. A table is repeatable to the bit; tables differ from each other by rounding. Plain arrays in and
// out, because the files behind it are compiled for one processor and must not leave inline functions behind.
// reentrant; no allocation. Private to engine/optim and its tests.
#pragma once

#include <cstdint>

#include "engine/optim/vector_level.h"
#include "hal/projection_constants.h"

namespace haustra::optim {

inline constexpr int kPoseNumbers = 12;  // rows of [R | t] of cam_from_world
inline constexpr int kPointNumbers = 4;  // x, y, z, and 1, or 0 for a point that stays where it is

// Observations of a window, grouped by point and within a point in the order of the free poses, and the state in which
// they are looked at. Arrays of observations, and rows that belong to them, are readable and writable kMaxVectorLanes
// beyond their end: the last vector of an array, or of a point, is worked on as a whole. Borrowed.
struct BundleView {
  ProjectionConstants camera;
  double huber_threshold = 0.0;  // sqrt of the gate
  double unseen_chi2 = 0.0;      // of a point that the camera cannot see
  // Of each observation. Indices beyond the end must be valid, too.
  const double* u = nullptr;
  const double* v = nullptr;
  const double* inverse_sigma = nullptr;
  const std::int32_t* pose = nullptr;
  const std::int32_t* free_pose = nullptr;  // index among the free poses; -1: none, and first among those of a point
  const std::int32_t* point = nullptr;
  const std::int32_t* begin = nullptr;  // of each point's observations, and the end of the last one's
  // State.
  const double* poses = nullptr;
  const double* points = nullptr;
};

// Whitened residuals and Jacobians, weighted with the root of Huber's weight: those of a stretch of observations that
// is small enough for the fastest cache. Number k of observation o stands at numbers[k * stride + o - first].
// Zero where the camera cannot see the point.
struct LinearisedObservations {
  enum Number { kResidual = 0, kByPoint = 2, kByPose = 8, kNumbers = 20 };  // 2, 2x3 and 2x6, by rows
  double* numbers = nullptr;
  int stride = 0;
  int first = 0;
};

// What the elimination of a point leaves for its back substitution: with V = L L^T the damped normal matrix, the
// inverse diagonal of L, its lower triangle, and z = L^-1 gradient. All zero for a point that does not move.
struct EliminatedPoint {
  double inverse_l00, inverse_l11, inverse_l22, l10, l20, l21;
  double z[3];
};

// The reduced system, to which points are added.
struct ReducedSystem {
  double* blocks = nullptr;     // lower block triangle by rows, 6x6 column-major; of a diagonal block all 36 count
  double* pose_sums = nullptr;  // of a free pose: gradient (6), diagonal of the normal matrix before elimination (6)
  EliminatedPoint* points = nullptr;
  // Of each observation 6x3: W L^-T with W its block of the normal matrix. The upper four rows column by column, then
  // the lower two, so that vectors of four are whole.
  double* y = nullptr;
};

struct BundleKernels {
  // Writes chi2 of the observations [begin, end) and, unless `out` is nullptr, linearises them. Returns half the sum of
  // Huber's loss.
  double (*Linearise)(const BundleView& view, int begin, int end, double* chi2, const LinearisedObservations* out);
  // Adds the points [begin, end), whose observations are linearised, to the system. Points must come in ascending
  // order.
  void (*Eliminate)(const BundleView& view, int begin, int end, double lambda, const LinearisedObservations& in,
                    const ReducedSystem& system);
};

const BundleKernels& BundleKernelsFor(VectorLevel level);

// Floor of a diagonal element for damping, relative to the largest of its block: a direction that nothing observes.
inline constexpr double kDiagonalFloor = 1e-6;

}  // namespace haustra::optim
