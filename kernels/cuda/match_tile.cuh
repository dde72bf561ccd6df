// Tiles of descriptors in shared memory and their products on tensor cores.
#pragma once

#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/match_kernels.h"

namespace haustra::kernels::cuda {

inline constexpr int kTrainTile = 128;
// 2^23 as a float: an integer below 2^23 added to its bits is 2^23 plus that integer. The largest product of two
// descriptors is 128 * 255^2 < 2^23.
inline constexpr int kFloatBase = 0x4b000000;
static_assert(kDescriptorBytes * 255 * 255 < 1 << 23);

__device__ __forceinline__ std::uint32_t SharedAddress(const void* p) {
  return static_cast<std::uint32_t>(__cvta_generic_to_shared(p));
}

// Rows of 128 bytes in eight pieces; pieces change places with the row so that eight rows meet in no bank.
__device__ __forceinline__ int Swizzled(int row, int piece) {
  return row * kDescriptorBytes + ((piece ^ (row & 7)) << 4);
}

__device__ __forceinline__ void CopyAsync16(std::uint32_t to, const void* from) {
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(to), "l"(from));
}
__device__ __forceinline__ void CopyAsync4(std::uint32_t to, const void* from) {
  asm volatile("cp.async.ca.shared.global [%0], [%1], 4;" ::"r"(to), "l"(from));
}
__device__ __forceinline__ void CommitCopies() { asm volatile("cp.async.commit_group;"); }
template <int kPending>
__device__ __forceinline__ void WaitForCopies() {
  asm volatile("cp.async.wait_group %0;" ::"n"(kPending));
}

__device__ __forceinline__ void LoadMatrices(std::uint32_t (&r)[4], std::uint32_t address) {
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 {%0, %1, %2, %3}, [%4];"
               : "=r"(r[0]), "=r"(r[1]), "=r"(r[2]), "=r"(r[3])
               : "r"(address));
}

__device__ __forceinline__ void MultiplyAdd(int (&sum)[4], const std::uint32_t (&a)[4], std::uint32_t b0,
                                            std::uint32_t b1) {
  asm volatile(
      "mma.sync.aligned.m16n8k32.row.col.s32.u8.u8.s32 {%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
      : "+r"(sum[0]), "+r"(sum[1]), "+r"(sum[2]), "+r"(sum[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
}

__device__ __forceinline__ void BeginSums(int (&sums)[2][4][4]) {
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int n = 0; n < 4; ++n) {
#pragma unroll
      for (int k = 0; k < 4; ++k) sums[m][n][k] = kFloatBase;
    }
  }
}

// Products of 32 queries and 32 train descriptors, on top of kFloatBase; train: address of the tile.
__device__ __forceinline__ void MultiplyPart(const std::uint32_t (&a)[2][4][4], std::uint32_t train, int first_column,
                                             int (&sums)[2][4][4]) {
  const int lane = threadIdx.x % 32;
  BeginSums(sums);
#pragma unroll
  for (int n = 0; n < 4; ++n) {
    std::uint32_t b[2][4];
    const int row = first_column + 8 * n + lane % 8;
    LoadMatrices(b[0], train + Swizzled(row, lane / 8));
    LoadMatrices(b[1], train + Swizzled(row, 4 + lane / 8));
#pragma unroll
    for (int m = 0; m < 2; ++m) {
      MultiplyAdd(sums[m][n], a[m][0], b[0][0], b[0][1]);
      MultiplyAdd(sums[m][n], a[m][1], b[0][2], b[0][3]);
      MultiplyAdd(sums[m][n], a[m][2], b[1][0], b[1][1]);
      MultiplyAdd(sums[m][n], a[m][3], b[1][2], b[1][3]);
    }
  }
}

}  // namespace haustra::kernels::cuda
