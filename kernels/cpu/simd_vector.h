// Vectors of the width that the including file is compiled for: 16 floats with AVX-512, 8 with AVX2, 4 otherwise (SSE2,
// NEON). Only for the *_impl.h files: everything has internal linkage and uses no inline function of the standard
// library, because the linker would otherwise be free to keep the copy that was built for the newest processor.
#pragma once

#include <cstdint>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace haustra::kernels {
namespace {

#if defined(__AVX512F__)
constexpr int kLanes = 16;
#elif defined(__AVX2__)
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;
#endif

typedef float VecF __attribute__((vector_size(kLanes * 4), may_alias));
typedef float VecFUnaligned __attribute__((vector_size(kLanes * 4), aligned(4), may_alias));
typedef std::int32_t VecI __attribute__((vector_size(kLanes * 4), may_alias));
typedef std::int32_t VecIUnaligned __attribute__((vector_size(kLanes * 4), aligned(4), may_alias));

inline VecF Load(const float* p) { return *reinterpret_cast<const VecFUnaligned*>(p); }
inline void Store(float* p, VecF v) { *reinterpret_cast<VecFUnaligned*>(p) = v; }
inline VecI LoadInts(const std::int32_t* p) { return *reinterpret_cast<const VecIUnaligned*>(p); }
inline void StoreInts(std::int32_t* p, VecI v) { *reinterpret_cast<VecIUnaligned*>(p) = v; }
inline VecF Splat(float x) { return x - VecF{}; }
inline VecI SplatInt(std::int32_t x) { return x - VecI{}; }
// 0, 1, 2, ...
inline VecF LaneNumbers() {
  VecF v{};
  for (int i = 0; i < kLanes; ++i) v[i] = static_cast<float>(i);
  return v;
}
inline VecF ToFloat(VecI v) { return __builtin_convertvector(v, VecF); }
// Towards zero.
inline VecI ToInt(VecF v) { return __builtin_convertvector(v, VecI); }
inline VecF Select(VecI mask, VecF a, VecF b) { return mask ? a : b; }
inline VecI SelectInt(VecI mask, VecI a, VecI b) { return mask ? a : b; }
inline VecF Abs(VecF v) { return reinterpret_cast<VecF>(reinterpret_cast<VecI>(v) & 0x7fffffff); }

inline VecF Max(VecF a, VecF b) {
#if defined(__AVX512F__)
  return _mm512_max_ps(a, b);
#elif defined(__AVX2__)
  return _mm256_max_ps(a, b);
#else
  return a > b ? a : b;
#endif
}

inline VecF Min(VecF a, VecF b) {
#if defined(__AVX512F__)
  return _mm512_min_ps(a, b);
#elif defined(__AVX2__)
  return _mm256_min_ps(a, b);
#else
  return a < b ? a : b;
#endif
}

inline VecF Sqrt(VecF v) {
#if defined(__AVX512F__)
  return _mm512_sqrt_ps(v);
#elif defined(__AVX2__)
  return _mm256_sqrt_ps(v);
#else
  for (int i = 0; i < kLanes; ++i) v[i] = __builtin_sqrtf(v[i]);
  return v;
#endif
}

// Bit i is set when lane i of the comparison result is true.
inline std::uint32_t MaskBits(VecI mask) {
#if defined(__AVX512F__)
  return _mm512_cmplt_epi32_mask(reinterpret_cast<__m512i>(mask), _mm512_setzero_si512());
#elif defined(__AVX2__)
  return static_cast<std::uint32_t>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
#else
  std::uint32_t bits = 0;
  for (int i = 0; i < kLanes; ++i) bits |= (mask[i] != 0 ? 1u : 0u) << i;
  return bits;
#endif
}

inline VecF Gather(const float* base, VecI index) {
#if defined(__AVX512F__)
  return _mm512_i32gather_ps(reinterpret_cast<__m512i>(index), base, 4);
#elif defined(__AVX2__)
  return _mm256_i32gather_ps(base, reinterpret_cast<__m256i>(index), 4);
#else
  VecF v;
  for (int i = 0; i < kLanes; ++i) v[i] = base[index[i]];
  return v;
#endif
}

}  // namespace
}  // namespace haustra::kernels
