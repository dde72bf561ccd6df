// One level of following a patch (kernels/common/flow_parameters.h) in compiler vectors; included by one source file
// for each SIMD level and nowhere else, like sift_kernels_impl.h.
#pragma once

#include "kernels/common/flow_parameters.h"
#include "kernels/cpu/sift_kernels.h"
#include "kernels/cpu/simd_vector.h"

namespace haustra::kernels {
namespace {

static_assert(kFlowPatchPx % kLanes == 0);

struct FlowPatch {
  alignas(64) float values[kFlowPatchArea];
};

inline float Sum(VecF v) {
  float sum = 0.0f;
  for (int i = 0; i < kLanes; ++i) sum += v[i];
  return sum;
}

// The patch around (x, y), between pixels.
inline void SamplePatch(const Plane& plane, float x, float y, FlowPatch* out) {
  const float left = x - 0.5f * (kFlowPatchPx - 1), top = y - 0.5f * (kFlowPatchPx - 1);
  const int first_x = static_cast<int>(left), first_y = static_cast<int>(top);
  const float right_part = left - static_cast<float>(first_x), lower_part = top - static_cast<float>(first_y);
  const VecF a = Splat((1.0f - right_part) * (1.0f - lower_part)), b = Splat(right_part * (1.0f - lower_part));
  const VecF c = Splat((1.0f - right_part) * lower_part), d = Splat(right_part * lower_part);
  for (int row = 0; row < kFlowPatchPx; ++row) {
    const float* upper = plane.row(first_y + row) + first_x;
    const float* lower = plane.row(first_y + row + 1) + first_x;
    for (int i = 0; i < kFlowPatchPx; i += kLanes) {
      Store(out->values + row * kFlowPatchPx + i,
            a * Load(upper + i) + b * Load(upper + i + 1) + c * Load(lower + i) + d * Load(lower + i + 1));
    }
  }
}

// Takes the mean away and divides by the deviation, which is returned.
inline float Normalise(FlowPatch* patch) {
  VecF sums{}, squares{};
  for (int i = 0; i < kFlowPatchArea; i += kLanes) sums += Load(patch->values + i);
  const VecF mean = Splat(Sum(sums) / kFlowPatchArea);
  for (int i = 0; i < kFlowPatchArea; i += kLanes) {
    const VecF value = Load(patch->values + i) - mean;
    squares += value * value;
    Store(patch->values + i, value);
  }
  const float variance = Sum(squares) / kFlowPatchArea;
  const float deviation = __builtin_sqrtf(variance > kFlowMinVariance ? variance : kFlowMinVariance);
  const VecF factor = Splat(1.0f / deviation);
  for (int i = 0; i < kFlowPatchArea; i += kLanes) Store(patch->values + i, Load(patch->values + i) * factor);
  return deviation;
}

inline bool IsInsideLevel(const Plane& plane, float x, float y) {
  return x >= kFlowMarginPx && y >= kFlowMarginPx && x < static_cast<float>(plane.width) - 1.0f - kFlowMarginPx &&
         y < static_cast<float>(plane.height) - 1.0f - kFlowMarginPx;
}

// Central differences of the patch around (x, y), in units of `deviation`.
inline void SampleGradients(const Plane& plane, float x, float y, float deviation, FlowPatch* along_x,
                            FlowPatch* along_y) {
  FlowPatch before;
  const VecF factor = Splat(0.5f / deviation);
  SamplePatch(plane, x - 1.0f, y, &before);
  SamplePatch(plane, x + 1.0f, y, along_x);
  for (int i = 0; i < kFlowPatchArea; i += kLanes) {
    Store(along_x->values + i, (Load(along_x->values + i) - Load(before.values + i)) * factor);
  }
  SamplePatch(plane, x, y - 1.0f, &before);
  SamplePatch(plane, x, y + 1.0f, along_y);
  for (int i = 0; i < kFlowPatchArea; i += kLanes) {
    Store(along_y->values + i, (Load(along_y->values + i) - Load(before.values + i)) * factor);
  }
}

float AlignPatch(const Plane& before, const Plane& now, float x, float y, float* x_now, float* y_now) {
  if (!IsInsideLevel(before, x, y)) return -1.0f;
  FlowPatch pattern, along_x, along_y, found;
  SamplePatch(before, x, y, &pattern);
  SampleGradients(before, x, y, Normalise(&pattern), &along_x, &along_y);
  VecF xx{}, xy{}, yy{};
  for (int i = 0; i < kFlowPatchArea; i += kLanes) {
    const VecF dx = Load(along_x.values + i), dy = Load(along_y.values + i);
    xx += dx * dx;
    xy += dx * dy;
    yy += dy * dy;
  }
  const float hxx = Sum(xx), hxy = Sum(xy), hyy = Sum(yy);
  const float determinant = hxx * hyy - hxy * hxy;
  const float half_trace = 0.5f * (hxx + hyy);
  const float root2 = half_trace * half_trace - determinant;
  if (half_trace - __builtin_sqrtf(root2 > 0.0f ? root2 : 0.0f) < kFlowMinGradient2 * kFlowPatchArea) return -1.0f;

  float correlation = -1.0f;
  for (int step = 0; step < kFlowMaxSteps; ++step) {
    if (!IsInsideLevel(now, *x_now, *y_now)) return -1.0f;
    SamplePatch(now, *x_now, *y_now, &found);
    Normalise(&found);
    VecF products{}, bx{}, by{};
    for (int i = 0; i < kFlowPatchArea; i += kLanes) {
      const VecF here = Load(found.values + i), there = Load(pattern.values + i);
      const VecF residual = here - there;
      products += here * there;
      bx += Load(along_x.values + i) * residual;
      by += Load(along_y.values + i) * residual;
    }
    correlation = Sum(products) / kFlowPatchArea;
    const float sum_x = Sum(bx), sum_y = Sum(by);
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

}  // namespace
}  // namespace haustra::kernels
