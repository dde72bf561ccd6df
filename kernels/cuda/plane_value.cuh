// How Gaussian images are stored: 16-bit counts, 65535 for intensity 1. Half the bytes of float, and finer than the
// contrast threshold by a factor of 170 (half-precision floats are too coarse near 1). Sums are taken in float.
#pragma once

#include <cstdint>

namespace haustra::kernels::cuda {

using PlaneValue = std::uint16_t;

inline constexpr float kCountsPerUnit = 65535.0f;
inline constexpr float kCountsPerGrey = 257.0f;

__device__ __forceinline__ float ToCounts(PlaneValue value) { return static_cast<float>(value); }
// On top of 2^23 a float's low bits are an integer. Additions that leave a value there are cheaper than conversions.
inline constexpr float kIntegerBase = 8388608.0f;
inline constexpr int kIntegerBaseBits = 0x4b000000;
// Of a number in [0, 2^23), rounded down.
struct WholePart {
  int integer;
  float value;
};
__device__ __forceinline__ WholePart ToWholePart(float number) {
  const float on_base = __fadd_rd(number, kIntegerBase);
  return {__float_as_int(on_base) - kIntegerBaseBits, on_base - kIntegerBase};
}
// The value on top of 2^23: as good as the value where values are subtracted from one another.
__device__ __forceinline__ float OnBase(PlaneValue value) { return __int_as_float(kIntegerBaseBits | value); }
__device__ __forceinline__ float LowOnBase(std::uint32_t two) {
  return __uint_as_float(__byte_perm(two, 0x4b000000u, 0x7610));
}
__device__ __forceinline__ float HighOnBase(std::uint32_t two) {
  return __uint_as_float(__byte_perm(two, 0x4b000000u, 0x7632));
}
__device__ __forceinline__ PlaneValue ToPlaneValue(float counts) {
  return static_cast<PlaneValue>(__float2uint_rn(fminf(fmaxf(counts, 0.0f), kCountsPerUnit)));
}
// Two neighbours in one word, the left one in the lower half.
__device__ __forceinline__ std::uint32_t ToPlaneValues(float left, float right) {
  return static_cast<std::uint32_t>(ToPlaneValue(left)) | static_cast<std::uint32_t>(ToPlaneValue(right)) << 16;
}

// Input pixels to an octave pixel, exactly.
__device__ __forceinline__ float ToInput(int octave) { return __int_as_float((octave + 127) << 23); }

}  // namespace haustra::kernels::cuda
