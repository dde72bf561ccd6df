// The best two train descriptors of each row, of products as match_tile.cuh makes them, where nothing else is asked
// for: without gates and mutual matching.
#pragma once

#include "kernels/cuda/match_common.cuh"
#include "kernels/cuda/match_tile.cuh"

namespace haustra::kernels::cuda {

// A warp has 32 queries and 64 train descriptors of a tile, in two parts of 32. Of each part a lane has four rows
// (8 * r + lane / 4) and eight columns (8 * n + 2 * (lane % 4) + {0, 1}). The group of a row that has its best goes to
// the lane of the row's number, through a slot: eight similarities, second best of the row so far, first column. The
// stride avoids bank conflicts.
inline constexpr int kSlotFloats = 12;

// Similarities of the products of a part; NaN or below all others for invalid train entries.
__device__ __forceinline__ void FindSimilarities(const int (&sums)[2][4][4], const float* query_norms,
                                                 const float* train_norms, float (&values)[4][8]) {
  const int lane = threadIdx.x % 32;
  float norms_of_rows[4];
#pragma unroll
  for (int r = 0; r < 4; ++r) norms_of_rows[r] = query_norms[8 * r + lane / 4];
#pragma unroll
  for (int n = 0; n < 4; ++n) {
    const float2 norms = *reinterpret_cast<const float2*>(train_norms + 8 * n + lane % 4 * 2);
#pragma unroll
    for (int r = 0; r < 4; ++r) {
#pragma unroll
      for (int e = 0; e < 2; ++e) {
        const float product = __int_as_float(sums[r / 2][n][r % 2 * 2 + e]) - __int_as_float(kFloatBase);
        values[r][2 * n + e] = __fmul_rn(product, __fmul_rn(e == 0 ? norms.x : norms.y, norms_of_rows[r]));
      }
    }
  }
}

// Whether any of a part may be above the second best of its row. Most need no more than a bound to be told: the product
// times the norm of the train descriptor, rounded once.
__device__ __forceinline__ bool MayEnter(const int (&sums)[2][4][4], const float* query_norms, const float* train_norms,
                                         const TwoNearest& top) {
  const int lane = threadIdx.x % 32;
  float bounds[4] = {};
#pragma unroll
  for (int n = 0; n < 4; ++n) {
    const float2 norms = *reinterpret_cast<const float2*>(train_norms + 8 * n + lane % 4 * 2);
    const float offset_x = -__int_as_float(kFloatBase) * norms.x;
    const float offset_y = -__int_as_float(kFloatBase) * norms.y;
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      bounds[r] = fmaxf(bounds[r], fmaf(__int_as_float(sums[r / 2][n][r % 2 * 2]), norms.x, offset_x));
      bounds[r] = fmaxf(bounds[r], fmaf(__int_as_float(sums[r / 2][n][r % 2 * 2 + 1]), norms.y, offset_y));
    }
  }
  constexpr float kAboveRounding = 1.000002f;
  bool may_enter = false;
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    const float bar = __shfl_sync(0xffffffffu, top.second, 8 * r + lane / 4);
    may_enter |= bounds[r] * query_norms[8 * r + lane / 4] * kAboveRounding > bar;
  }
  return __any_sync(0xffffffffu, may_enter);
}

// Takes the similarities of a warp, kParts times 32 columns of 32 rows, into the best two of row `lane`. The eight that
// a lane has of a row and a part are a group: the best of the row is in the group with the highest maximum, the second
// best is in it, too, or is the second highest maximum. So all but one group need no more than that.
template <int kParts>
__device__ __forceinline__ void Enter(const float (&values)[kParts][4][8], int first_column, float* slots,
                                      TwoNearest& top) {
  const int lane = threadIdx.x % 32;
  float maxima[kParts][4];
  float best[4];
  float second[4];
  bool is_shared = false;
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    best[r] = second[r] = -1.0f;
#pragma unroll
    for (int p = 0; p < kParts; ++p) {
      float highest = -1.0f;
#pragma unroll
      for (int c = 0; c < 8; ++c) highest = fmaxf(highest, values[p][r][c]);
      maxima[p][r] = highest;
      second[r] = fmaxf(second[r], fminf(best[r], highest));
      best[r] = fmaxf(best[r], highest);
    }
#pragma unroll
    for (int step = 1; step < 4; step *= 2) {
      const float other_best = __shfl_xor_sync(0xffffffffu, best[r], step);
      const float other_second = __shfl_xor_sync(0xffffffffu, second[r], step);
      second[r] = fmaxf(fminf(best[r], other_best), fmaxf(second[r], other_second));
      best[r] = fmaxf(best[r], other_best);
    }
    is_shared |= second[r] == best[r];
  }
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    float* slot = slots + (8 * r + lane / 4) * kSlotFloats;
#pragma unroll
    for (int p = 0; p < kParts; ++p) {
      if (maxima[p][r] != best[r] || second[r] == best[r]) continue;
      const float(&v)[8] = values[p][r];
      *reinterpret_cast<float4*>(slot) = {v[0], v[1], v[2], v[3]};
      *reinterpret_cast<float4*>(slot + 4) = {v[4], v[5], v[6], v[7]};
      *reinterpret_cast<float2*>(slot + 8) = {second[r], __int_as_float(32 * p + lane % 4 * 2)};
    }
  }
  if (__any_sync(0xffffffffu, is_shared)) {
    // Several groups of a row have its best: of equal ones, the lowest column has it. (Or no group has any.)
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      int column = kTrainTile;
#pragma unroll
      for (int p = kParts - 1; p >= 0; --p) {
#pragma unroll
        for (int c = 7; c >= 0; --c) {
          if (values[p][r][c] == best[r]) column = 32 * p + 8 * (c / 2) + lane % 4 * 2 + c % 2;
        }
      }
#pragma unroll
      for (int step = 1; step < 4; step *= 2) column = min(column, __shfl_xor_sync(0xffffffffu, column, step));
      if (second[r] == best[r] && lane % 4 == 0) {
        float* slot = slots + (8 * r + lane / 4) * kSlotFloats;
        *reinterpret_cast<float4*>(slot) = {best[r], -1.0f, -1.0f, -1.0f};
        *reinterpret_cast<float4*>(slot + 4) = {-1.0f, -1.0f, -1.0f, -1.0f};
        *reinterpret_cast<float2*>(slot + 8) = {best[r], __int_as_float(column)};
      }
    }
  }
  __syncwarp();
  const float* slot = slots + lane * kSlotFloats;
  const float4 v[2] = {reinterpret_cast<const float4*>(slot)[0], reinterpret_cast<const float4*>(slot)[1]};
  const float2 further = *reinterpret_cast<const float2*>(slot + 8);
  const float group[8] = {v[0].x, v[0].y, v[0].z, v[0].w, v[1].x, v[1].y, v[1].z, v[1].w};
  float best_of_group = -1.0f;
  float second_of_row = further.x;
  int place = 0;
#pragma unroll
  for (int c = 0; c < 8; ++c) {
    const float value = fmaxf(group[c], -1.0f);
    second_of_row = fmaxf(second_of_row, fminf(best_of_group, value));
    if (value > best_of_group) {
      best_of_group = value;
      place = 8 * (c / 2) + c % 2;
    }
  }
  Join(top, best_of_group, second_of_row, first_column + __float_as_int(further.y) + place);
  __syncwarp();
}

}  // namespace haustra::kernels::cuda
