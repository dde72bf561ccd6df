// The inner loops of extraction, one table for each SIMD level (sift_kernels_impl.h holds the code).
#pragma once

#include <cstdint>

#include "kernels/common/gaussian_kernel.h"
#include "kernels/common/sift_parameters.h"
#include "kernels/cpu/simd_level.h"

namespace haustra::kernels {

// Rows of planes start at multiples of this many floats.
inline constexpr int kStrideAlignment = 16;
// Floats in front of and behind a plane that may be read (not used).
inline constexpr int kPlanePadding = 32;

// Float image, intensities in [0, 1]; rows `stride` floats apart.
struct Plane {
  float* data = nullptr;
  int width = 0;
  int height = 0;
  int stride = 0;

  float* row(int y) const { return data + static_cast<std::ptrdiff_t>(y) * stride; }
};

// A local extremum of the difference of Gaussians on the sampling grid.
struct Extremum {
  std::int16_t x = 0;
  std::int16_t y = 0;
  std::int16_t level = 0;  // [1, kScalesPerOctave]
  float response = 0.0f;   // |DoG|
};

// Columns in a strip of the extremum search, small enough for the rows of all levels to stay in the first-level cache.
inline constexpr int kStripWidth = 384;
inline constexpr int kStripHalo = 16;
inline constexpr int kExtremaScratchFloats = 3 * (kNumLevels - 1) * (kStripWidth + 2 * kStripHalo);

// Where to sample a patch: octave pixels, radians.
struct PatchFrame {
  float x = 0.0f;
  float y = 0.0f;
  float scale = 0.0f;  // of the keypoint, octave pixels
  float angle = 0.0f;
};

struct SiftKernels {
  // Rows [y_begin, y_end) of the input at twice its size, in [0, 1]: out(2x, 2y) = in(x, y), linear in between.
  void (*UpsampleRows)(const std::uint8_t* grey, int width, int height, int pitch_bytes, const Plane& out, int y_begin,
                       int y_end, float* scratch);
  // Rows [y_begin, y_end) of the input as they are, in [0, 1].
  void (*ConvertRows)(const std::uint8_t* grey, int width, int pitch_bytes, const Plane& out, int y_begin, int y_end);
  // Rows [y_begin, y_end) of `in` convolved with the kernel both ways; edge pixels are repeated outwards. Scratch:
  // stride + 4 * kPlanePadding floats.
  void (*BlurRows)(const Plane& in, const Plane& out, const GaussianKernel& kernel, int y_begin, int y_end,
                   float* scratch);
  // Every second pixel of every second row, output rows [y_begin, y_end).
  void (*DecimateRows)(const Plane& in, const Plane& out, int y_begin, int y_end);
  // Extrema of the differences of the kNumLevels planes among their 26 neighbours, above the threshold in absolute
  // value, in rows [y_begin, y_end), at least kEdgeMarginPx inside. Returns their number; when they are more than
  // `capacity`, the threshold rises until they fit, so that the weakest are left out. Scratch: kExtremaScratchFloats.
  int (*FindExtrema)(const Plane* levels, float threshold, int y_begin, int y_end, Extremum* out, int capacity,
                     float* scratch);
  // Dominant orientations of a point, strongest first, at most kMaxOrientations; returns their number. frame.angle
  // unused.
  int (*FindOrientations)(const Plane& level, const PatchFrame& frame, float* angles);
  // One level of following a feature (kernels/common/flow_parameters.h): from a first guess in (x_now, y_now), which is
  // moved to where the patch around (x, y) of `before` is in `now`. Returns how well the two correlate; negative: there
  // is no answer, and x_now and y_now mean nothing.
  float (*AlignPatch)(const Plane& before, const Plane& now, float x, float y, float* x_now, float* y_now);
  // The 128 bytes of a descriptor.
  void (*Describe)(const Plane& level, const PatchFrame& frame, bool root_sift, std::uint8_t* descriptor);
};

// The level must be supported (simd_level.h).
const SiftKernels& SiftKernelsFor(SimdLevel level);

}  // namespace haustra::kernels
