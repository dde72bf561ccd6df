// Vectors of doubles of the width that the including file is compiled for: 4 with AVX2, 2 otherwise (SSE2, NEON). Only
// for *_impl.h files that are compiled once for each instruction set: everything has internal linkage and uses no
// inline function of any library, because the linker would otherwise be free to keep the copy that was built for the
// newest processor.
#pragma once

#include <cstdint>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace haustra {
namespace {

#if defined(__AVX2__)
constexpr int kLanes = 4;
#else
constexpr int kLanes = 2;
#endif

typedef double VecD __attribute__((vector_size(kLanes * 8), may_alias));
typedef double VecDUnaligned __attribute__((vector_size(kLanes * 8), aligned(8), may_alias));
// What a comparison gives: all bits set where it holds.
typedef std::int64_t VecMask __attribute__((vector_size(kLanes * 8)));

inline VecD Load(const double* p) { return *reinterpret_cast<const VecDUnaligned*>(p); }
inline void Store(double* p, VecD v) { *reinterpret_cast<VecDUnaligned*>(p) = v; }
inline VecD Splat(double x) { return x - VecD{}; }
inline VecD Select(VecMask mask, VecD a, VecD b) { return mask ? a : b; }
inline VecD Abs(VecD v) { return v < VecD{} ? -v : v; }

// The first `num` lanes.
inline VecMask FirstLanes(int num) {
  VecD number{};
  for (int i = 0; i < kLanes; ++i) number[i] = i;
  return number < Splat(num);
}

inline bool IsAll(VecMask mask) {
#if defined(__AVX2__)
  return _mm256_movemask_pd(reinterpret_cast<__m256d>(mask)) == 0xf;
#else
  return (mask[0] & mask[1]) != 0;
#endif
}

inline VecD Sqrt(VecD v) {
#if defined(__AVX2__)
  return _mm256_sqrt_pd(v);
#else
  for (int i = 0; i < kLanes; ++i) v[i] = __builtin_sqrt(v[i]);
  return v;
#endif
}

// Rows become columns.
inline void Transpose(VecD rows[kLanes]) {
#if defined(__AVX2__)
  const VecD even01 = _mm256_unpacklo_pd(rows[0], rows[1]), odd01 = _mm256_unpackhi_pd(rows[0], rows[1]);
  const VecD even23 = _mm256_unpacklo_pd(rows[2], rows[3]), odd23 = _mm256_unpackhi_pd(rows[2], rows[3]);
  rows[0] = _mm256_permute2f128_pd(even01, even23, 0x20);
  rows[1] = _mm256_permute2f128_pd(odd01, odd23, 0x20);
  rows[2] = _mm256_permute2f128_pd(even01, even23, 0x31);
  rows[3] = _mm256_permute2f128_pd(odd01, odd23, 0x31);
#else
  const VecD first = {rows[0][0], rows[1][0]}, second = {rows[0][1], rows[1][1]};
  rows[0] = first;
  rows[1] = second;
#endif
}

// One row of kCount numbers for each lane, from a table of such rows: values[k] holds number k of all lanes.
template <int kCount>
inline void GatherRows(const double* table, const std::int32_t row[kLanes], VecD values[kCount]) {
  static_assert(kCount % kLanes == 0);
  for (int k = 0; k < kCount; k += kLanes) {
    for (int i = 0; i < kLanes; ++i) values[k + i] = Load(table + kCount * static_cast<std::int64_t>(row[i]) + k);
    Transpose(values + k);
  }
}

// The reverse: number k of lane i goes to rows[stride i + k]. A count that is not a multiple of the lanes is fine.
template <int kCount>
inline void StoreRows(const VecD values[kCount], double* rows, int stride) {
  static_assert(kCount >= kLanes);
  for (int k = 0; k < kCount; k += kLanes) {
    const int from = k + kLanes <= kCount ? k : kCount - kLanes;
    VecD block[kLanes];
    for (int i = 0; i < kLanes; ++i) block[i] = values[from + i];
    Transpose(block);
    for (int i = 0; i < kLanes; ++i) Store(rows + static_cast<std::int64_t>(stride) * i + from, block[i]);
  }
}

// sums[k]: of the lanes of values[k].
template <int kCount>
inline void SumLanes(const VecD values[kCount], double sums[kCount]) {
  static_assert(kCount % kLanes == 0);
  for (int k = 0; k < kCount; k += kLanes) {
    VecD block[kLanes];
    for (int i = 0; i < kLanes; ++i) block[i] = values[k + i];
    Transpose(block);
    VecD sum = block[0];
    for (int i = 1; i < kLanes; ++i) sum += block[i];
    Store(sums + k, sum);
  }
}

}  // namespace
}  // namespace haustra
