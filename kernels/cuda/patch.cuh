// What orientation and descriptor share.
#pragma once

namespace haustra::kernels::cuda {

inline constexpr float kTwoPi = 6.28318530717958647692f;
inline constexpr float kPi = 3.14159265358979323846f;

// Angle of (x, y) in [0, 2 pi); error below 2e-5 rad (polynomial 4.4.47 of Abramowitz and Stegun); 0 for (0, 0). The
// same as the CPU device's.
__device__ __forceinline__ float Atan2(float y, float x) {
  const float ax = fabsf(x);
  const float ay = fabsf(y);
  const float a = __fdividef(fminf(ax, ay), fmaxf(ax, ay) + 1e-30f);
  const float s = a * a;
  float r = ((((0.0208351f * s - 0.0851330f) * s + 0.1801410f) * s - 0.3302995f) * s + 0.9998660f) * a;
  r = ay > ax ? kPi / 2 - r : r;
  r = x < 0.0f ? kPi - r : r;
  r = y < 0.0f ? kTwoPi - r : r;
  return r >= kTwoPi ? 0.0f : r;
}

}  // namespace haustra::kernels::cuda
