// pose_kernels.h in vectors; included by one source file for each instruction set and nowhere else. Internal linkage
// throughout (engine/geometry/lanes.h).
#pragma once

#include "engine/camera/lane_projection.h"
#include "engine/geometry/lanes.h"
#include "engine/optim/pose_kernels.h"

namespace haustra::optim {
namespace {

static_assert(kLanes <= kMaxVectorLanes);

// The errors of as many observations as there are lanes, in sigmas.
struct LaneErrors {
  VecD p[3];  // the points in the camera
  LaneProjection projection;
  VecD inverse_sigma;
  VecD residual[2];
  VecD chi2;  // infinite where the point cannot be seen
};

// Lanes beyond the last observation repeat it.
inline LaneErrors ErrorsFrom(const PoseView& view, const double* pose, int first) {
  std::int32_t row[kLanes];
  for (int i = 0; i < kLanes; ++i) row[i] = first + i < view.num ? first + i : view.num - 1;
  VecD observation[kPoseObservationNumbers];
  GatherRows<kPoseObservationNumbers>(view.observations, row, observation);
  LaneErrors errors;
  for (int i = 0; i < 3; ++i) {
    const double* const r = pose + 4 * i;
    errors.p[i] = r[0] * observation[0] + r[1] * observation[1] + r[2] * observation[2] + r[3];
  }
  errors.projection = ProjectLanes(view.camera, errors.p[0], errors.p[1], errors.p[2]);
  errors.inverse_sigma = 1.0 / observation[6];
  errors.residual[0] = (errors.projection.u - observation[4]) * errors.inverse_sigma;
  errors.residual[1] = (errors.projection.v - observation[5]) * errors.inverse_sigma;
  const VecD chi2 = errors.residual[0] * errors.residual[0] + errors.residual[1] * errors.residual[1];
  errors.chi2 = Select(errors.projection.is_seen, chi2, Splat(__builtin_inf()));
  return errors;
}

inline VecMask UsedFrom(const PoseView& view, int first) {
  const VecMask is_there = FirstLanes(view.num - first);
  if (view.used == nullptr) return is_there;
  VecD used{};
  for (int i = 0; i < kLanes && first + i < view.num; ++i) used[i] = view.used[first + i];
  return is_there & (used != VecD{});
}

double Linearise(const PoseView& view, const double* pose, PoseNormals* normals) {
  VecD sums[PoseNormals::kNumbers] = {};
  VecD cost{};
  for (int o = 0; o < view.num; o += kLanes) {
    const VecMask is_used = UsedFrom(view, o);
    const LaneErrors errors = ErrorsFrom(view, pose, o);
    VecD observation_cost = errors.chi2, weight = Splat(1.0);
    if (view.robust_scale2 > 0.0) {
      // The quotient of an infinite error is none.
      const VecD ratio = view.robust_scale2 / (view.robust_scale2 + errors.chi2);
      observation_cost = Select(errors.projection.is_seen, ratio * errors.chi2, Splat(view.robust_scale2));
      weight = ratio * ratio;
    }
    cost += Select(is_used, observation_cost, VecD{});

    const VecMask counts = is_used & errors.projection.is_seen;
    const VecD scale = errors.inverse_sigma, *const p = errors.p;
    for (int r = 0; r < 2; ++r) {
      VecD jacobian[6];  // d point / d (rho, phi) = [I, -Skew(point)]: the rotation's part of a row is point x row
      for (int i = 0; i < 3; ++i) jacobian[i] = Select(counts, errors.projection.jacobian[r][i] * scale, VecD{});
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        jacobian[3 + i] = Select(counts, p[j] * jacobian[k] - p[k] * jacobian[j], VecD{});
      }
      const VecD residual = Select(counts, errors.residual[r], VecD{});
      int n = PoseNormals::kHessian;
      for (int i = 0; i < 6; ++i) {
        const VecD weighted = weight * jacobian[i];
        for (int j = 0; j <= i; ++j) sums[n++] += weighted * jacobian[j];
        sums[PoseNormals::kGradient + i] += weighted * residual;
      }
    }
  }
  SumLanes<PoseNormals::kNumbers>(sums, normals->numbers);
  double lanes[kLanes], sum = 0.0;
  Store(lanes, cost);
  for (const double lane : lanes) sum += lane;
  return sum;
}

void Errors(const PoseView& view, const double* pose, int begin, int end, double* chi2) {
  for (int o = begin; o < end; o += kLanes) Store(chi2 + (o - begin), ErrorsFrom(view, pose, o).chi2);
}

constexpr PoseKernels kKernels = {&Linearise, &Errors};

}  // namespace
}  // namespace haustra::optim
