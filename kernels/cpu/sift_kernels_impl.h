// The inner loops of extraction in compiler vectors; included by one source file for each SIMD level and nowhere else.
// Internal linkage throughout (see simd_vector.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "kernels/common/sift_parameters.h"
#include "kernels/cpu/patch_alignment_impl.h"
#include "kernels/cpu/sift_kernels.h"
#include "kernels/cpu/sift_tables.h"
#include "kernels/cpu/simd_vector.h"

namespace haustra::kernels {
namespace {

constexpr float kTwoPi = 6.28318530717958647692f;
constexpr float kPi = 3.14159265358979323846f;

inline int ClampInt(int v, int lo, int hi) { return v < lo ? lo : (v > hi ? hi : v); }

// ---- Scale space ----------------------------------------------------------------------------------------------------

void UpsampleRows(const std::uint8_t* grey, int width, int height, int pitch_bytes, const Plane& out, int y_begin,
                  int y_end, float* scratch) {
  constexpr float kHalfUnit = 0.5f / 255.0f;
  for (int y = y_begin; y < y_end; ++y) {
    const int y0 = y / 2;
    const int y1 = ClampInt(y0 + (y & 1), 0, height - 1);
    const std::uint8_t* a = grey + static_cast<std::ptrdiff_t>(y0) * pitch_bytes;
    const std::uint8_t* b = grey + static_cast<std::ptrdiff_t>(y1) * pitch_bytes;
    for (int x = 0; x < width; ++x) scratch[x] = static_cast<float>(a[x] + b[x]) * kHalfUnit;
    scratch[width] = scratch[width - 1];
    float* row = out.row(y);
    for (int x = 0; x < width; ++x) {
      row[2 * x] = scratch[x];
      row[2 * x + 1] = 0.5f * (scratch[x] + scratch[x + 1]);
    }
    for (int x = 2 * width; x < out.stride; ++x) row[x] = row[2 * width - 1];
  }
}

void ConvertRows(const std::uint8_t* grey, int width, int pitch_bytes, const Plane& out, int y_begin, int y_end) {
  constexpr float kUnit = 1.0f / 255.0f;
  for (int y = y_begin; y < y_end; ++y) {
    const std::uint8_t* from = grey + static_cast<std::ptrdiff_t>(y) * pitch_bytes;
    float* row = out.row(y);
    for (int x = 0; x < width; ++x) row[x] = static_cast<float>(from[x]) * kUnit;
    for (int x = width; x < out.stride; ++x) row[x] = row[width - 1];
  }
}

template <int kRadius>
void BlurRowsWithRadius(const Plane& in, const Plane& out, const float* weights, int y_begin, int y_end,
                        float* scratch) {
  VecF w[kRadius + 1];
  for (int j = 0; j <= kRadius; ++j) w[j] = Splat(weights[j]);
  float* line = scratch + kPlanePadding;
  for (int y = y_begin; y < y_end; ++y) {
    const float* rows[2 * kRadius + 1];
    for (int j = -kRadius; j <= kRadius; ++j) rows[kRadius + j] = in.row(ClampInt(y + j, 0, in.height - 1));
    for (int x = 0; x < in.stride; x += kLanes) {
      VecF sum = w[0] * Load(rows[kRadius] + x);
#pragma GCC unroll 16
      for (int j = 1; j <= kRadius; ++j) sum += w[j] * (Load(rows[kRadius - j] + x) + Load(rows[kRadius + j] + x));
      Store(line + x, sum);
    }
    const float left = line[0];
    const float right = line[in.width - 1];
    for (int x = 1; x <= kPlanePadding; ++x) line[-x] = left;
    for (int x = in.width; x < in.stride + kPlanePadding; ++x) line[x] = right;
    float* row = out.row(y);
    for (int x = 0; x < out.stride; x += kLanes) {
      VecF sum = w[0] * Load(line + x);
#pragma GCC unroll 16
      for (int j = 1; j <= kRadius; ++j) sum += w[j] * (Load(line + x - j) + Load(line + x + j));
      Store(row + x, sum);
    }
  }
}

void BlurRows(const Plane& in, const Plane& out, const GaussianKernel& kernel, int y_begin, int y_end, float* scratch) {
  switch (kernel.radius) {
#define HAUSTRA_BLUR_CASE(radius) \
  case radius: return BlurRowsWithRadius<radius>(in, out, kernel.weights, y_begin, y_end, scratch)
    HAUSTRA_BLUR_CASE(1);
    HAUSTRA_BLUR_CASE(2);
    HAUSTRA_BLUR_CASE(3);
    HAUSTRA_BLUR_CASE(4);
    HAUSTRA_BLUR_CASE(5);
    HAUSTRA_BLUR_CASE(6);
    HAUSTRA_BLUR_CASE(7);
    HAUSTRA_BLUR_CASE(8);
    HAUSTRA_BLUR_CASE(9);
    HAUSTRA_BLUR_CASE(10);
    HAUSTRA_BLUR_CASE(11);
    HAUSTRA_BLUR_CASE(12);
    HAUSTRA_BLUR_CASE(13);
    HAUSTRA_BLUR_CASE(14);
    HAUSTRA_BLUR_CASE(15);
    HAUSTRA_BLUR_CASE(16);
#undef HAUSTRA_BLUR_CASE
    default: return;
  }
}

void DecimateRows(const Plane& in, const Plane& out, int y_begin, int y_end) {
  for (int y = y_begin; y < y_end; ++y) {
    const float* from = in.row(2 * y);
    float* to = out.row(y);
    for (int x = 0; x < out.width; ++x) to[x] = from[2 * x];
    for (int x = out.width; x < out.stride; ++x) to[x] = to[out.width - 1];
  }
}

// ---- Extrema --------------------------------------------------------------------------------------------------------

// Keeps the extrema above a threshold that rises until half of the room is free again.
int KeepStrongest(Extremum* extrema, int count, int capacity, float* threshold) {
  while (count > capacity / 2) {
    *threshold *= 1.25f;
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      if (extrema[i].response > *threshold) extrema[kept++] = extrema[i];
    }
    count = kept;
  }
  return count;
}

// Whether the value at a point of a difference of Gaussians, already known to be extremal among its four nearest
// neighbours, is so among all 26; sign 1: maximum, -1: minimum. Rows are those above, at and below the point.
inline bool IsExtremum(const float* const rows[3][3], int column, float sign) {
  const float value = sign * rows[1][1][column];
  for (const int dog : {0, 2, 1}) {
    for (int r = 0; r < 3; ++r) {
      const float* row = rows[dog][r] + column;
      if (sign * row[0] > value || sign * row[-1] > value || sign * row[1] > value) return false;
    }
  }
  return true;
}

int FindExtrema(const Plane* levels, float threshold, int y_begin, int y_end, Extremum* out, int capacity,
                float* scratch) {
  constexpr int kDogs = kNumLevels - 1;
  constexpr int kPitch = kStripWidth + 2 * kStripHalo;
  const int width = levels[0].width;
  const int height = levels[0].height;
  // [row % 3][dog][column] of the strip.
  const auto dog_row = [&](int y, int dog) {
    return scratch + (static_cast<std::ptrdiff_t>(y % 3) * kDogs + dog) * kPitch;
  };

  const int first_row = y_begin < kEdgeMarginPx ? kEdgeMarginPx : y_begin;
  const int last_row = y_end > height - kEdgeMarginPx ? height - kEdgeMarginPx : y_end;
  const int last_column = width - kEdgeMarginPx;
  if (first_row >= last_row) return 0;
  int count = 0;
  for (int x0 = 0; x0 < width; x0 += kStripWidth) {
    // Strip column i is plane column x0 + i - kStripHalo.
    int used = width - x0 < kStripWidth ? width - x0 : kStripWidth;
    used = (used + kLanes - 1) / kLanes * kLanes;
    const auto compute_dogs = [&](int y) {
      for (int d = 0; d < kDogs; ++d) {
        const float* fine = levels[d].row(y) + x0 - kStripHalo;
        const float* coarse = levels[d + 1].row(y) + x0 - kStripHalo;
        float* dog = dog_row(y, d);
        for (int i = kStripHalo - kLanes; i < kStripHalo + used + kLanes; i += kLanes) {
          Store(dog + i, Load(coarse + i) - Load(fine + i));
        }
      }
    };
    compute_dogs(first_row - 1);
    compute_dogs(first_row);
    for (int y = first_row; y < last_row; ++y) {
      compute_dogs(y + 1);
      for (int level = 1; level <= kScalesPerOctave; ++level) {
        const float* rows[3][3];
        for (int d = 0; d < 3; ++d) {
          for (int r = 0; r < 3; ++r) rows[d][r] = dog_row(y + r - 1, level + d - 1);
        }
        const float* above = rows[1][0];
        const float* here = rows[1][1];
        const float* below = rows[1][2];
        for (int i = kStripHalo; i < kStripHalo + used; i += kLanes) {
          // Most points fail against their four nearest neighbours; only the rest is looked at one by one.
          const VecF value = Load(here + i);
          const VecF left = Load(here + i - 1);
          const VecF right = Load(here + i + 1);
          const VecF up = Load(above + i);
          const VecF down = Load(below + i);
          const VecF highest = Max(Max(Max(left, right), Max(up, down)), Splat(threshold));
          const VecF lowest = Min(Min(Min(left, right), Min(up, down)), Splat(-threshold));
          std::uint32_t bits = MaskBits((value >= highest) | (value <= lowest));
          for (; bits != 0; bits &= bits - 1) {
            const int column = i + __builtin_ctz(bits);
            const int x = x0 + column - kStripHalo;
            const float response = __builtin_fabsf(here[column]);
            if (x < kEdgeMarginPx || x >= last_column || response <= threshold) continue;
            if (!IsExtremum(rows, column, here[column] > 0.0f ? 1.0f : -1.0f)) continue;
            if (count == capacity) count = KeepStrongest(out, count, capacity, &threshold);
            if (response <= threshold) continue;
            out[count++] = Extremum{static_cast<std::int16_t>(x), static_cast<std::int16_t>(y),
                                    static_cast<std::int16_t>(level), response};
          }
        }
      }
    }
  }
  return count;
}

// ---- Patches --------------------------------------------------------------------------------------------------------

// Angle of (x, y) in [0, 2 pi); error below 2e-5 rad (polynomial 4.4.47 of Abramowitz and Stegun); 0 for (0, 0).
inline VecF Atan2(VecF y, VecF x) {
  const VecF ax = Abs(x);
  const VecF ay = Abs(y);
  const VecF a = Min(ax, ay) / (Max(ax, ay) + 1e-30f);
  const VecF s = a * a;
  VecF r = ((((0.0208351f * s - 0.0851330f) * s + 0.1801410f) * s - 0.3302995f) * s + 0.9998660f) * a;
  r = Select(ay > ax, kPi / 2 - r, r);
  r = Select(x < 0.0f, kPi - r, r);
  r = Select(y < 0.0f, kTwoPi - r, r);
  return Select(r >= kTwoPi, Splat(0.0f), r);
}

// e^x for x <= 0, relative error below 2e-6: 2^f by its series on [-0.5, 0.5], times a power of two by exponent.
inline VecF ExpNegative(VecF x) {
  const VecF t = Max(x, Splat(-80.0f)) * 1.44269504f;
  const VecI n = ToInt(t - 0.5f);  // rounds, since t <= 0
  const VecF f = (t - ToFloat(n)) * 0.69314718f;
  const VecF p =
      1.0f + f * (1.0f + f * (0.5f + f * (1.0f / 6 + f * (1.0f / 24 + f * (1.0f / 120 + f * (1.0f / 720))))));
  return p * reinterpret_cast<VecF>((n + 127) << 23);
}

// Gradients of a plane at the points of a grid around a keypoint, taken at the pixel nearest to each point (the
// distance is small against the cells). Grid axes (ux, uy) and (-uy, ux) in octave pixels. magnitudes: weighted, 0
// outside the plane; bins: angles relative to the grid's axes, in orientations of the descriptor.
inline void SampleGradients(const Plane& plane, const DescriptorTables& tables, float x, float y, float ux, float uy,
                            float* magnitudes, float* bins) {
  constexpr int kReach = kDescriptorGradientReachPx;
  const float first = static_cast<float>(kReach);
  const float last_x = static_cast<float>(plane.width - 1 - kReach);
  const float last_y = static_cast<float>(plane.height - 1 - kReach);
  const std::ptrdiff_t down = static_cast<std::ptrdiff_t>(kReach) * plane.stride;
  for (int i = 0; i < DescriptorTables::kPaddedSize; i += kLanes) {
    const VecF u = Load(tables.u + i);
    const VecF v = Load(tables.v + i);
    const VecF px = x + u * ux - v * uy + 0.5f;
    const VecF py = y + u * uy + v * ux + 0.5f;
    const VecI is_inside = (px >= first) & (py >= first) & (px < last_x + 1.0f) & (py < last_y + 1.0f);
    const VecI ix = ToInt(Min(Max(px, Splat(first)), Splat(last_x)));
    const VecI iy = ToInt(Min(Max(py, Splat(first)), Splat(last_y)));
    const VecI index = iy * plane.stride + ix;
    const VecF dx = Gather(plane.data + kReach, index) - Gather(plane.data - kReach, index);
    const VecF dy = Gather(plane.data + down, index) - Gather(plane.data - down, index);
    // The axes have the length of the grid's spacing, which an angle does not notice.
    Store(magnitudes + i, Select(is_inside, Sqrt(dx * dx + dy * dy) * Load(tables.weights + i), Splat(0.0f)));
    Store(bins + i, Atan2(dy * ux - dx * uy, dx * ux + dy * uy) * (kDescriptorOrientations / kTwoPi));
  }
}

int FindOrientations(const Plane& level, const PatchFrame& frame, float* angles) {
  constexpr int kSide = 2 * kOrientationReachPx;
  static_assert(kSide % kStrideAlignment == 0 && kOrientationReachPx + 1 <= kPlanePadding);
  const int first_x = static_cast<int>(frame.x) + 1 - kOrientationReachPx;
  const int centre_y = static_cast<int>(frame.y);
  const int reach = ClampInt(static_cast<int>(kOrientationReachSigmas * kOrientationWindowSigma * frame.scale) + 1, 1,
                             kOrientationReachPx);
  const float falloff = -0.5f / (kOrientationWindowSigma * kOrientationWindowSigma * frame.scale * frame.scale);
  // Gaussian of the distances of columns and rows; rows count from the same offset as columns.
  alignas(64) float column_weights[kSide];
  alignas(64) float row_weights[kSide];
  const int first_y = centre_y + 1 - kOrientationReachPx;
  const VecF column_offset = Splat(static_cast<float>(first_x) - frame.x);
  const VecF row_offset = Splat(static_cast<float>(first_y) - frame.y);
  for (int i = 0; i < kSide; i += kLanes) {
    const VecF position = LaneNumbers() + static_cast<float>(i);
    const VecF dx = position + column_offset;
    const VecF dy = position + row_offset;
    const VecF x = position + static_cast<float>(first_x);
    const VecI is_inside = (x >= 1.0f) & (x <= static_cast<float>(level.width - 2));
    Store(column_weights + i, Select(is_inside, ExpNegative(falloff * dx * dx), Splat(0.0f)));
    Store(row_weights + i, ExpNegative(falloff * dy * dy));
  }
  // Four histograms in turn, so that no addition waits for the one before; the last two bins wrap around (an angle may
  // round up to a full turn).
  float histograms[4][kOrientationBins + 2] = {};
  for (int y = centre_y + 1 - reach; y <= centre_y + reach; ++y) {
    if (y < 1 || y > level.height - 2) continue;
    const float row_weight = row_weights[y - first_y];
    const float distance = static_cast<float>(y) - frame.y;
    // Columns outside the plane are read as well (rows are padded), with weight 0.
    const float* row = level.row(y) + first_x;
    alignas(64) float to_lower[kSide];
    alignas(64) float to_upper[kSide];
    alignas(64) std::int32_t lower[kSide];
    for (int c = 0; c < kSide; c += kLanes) {
      const VecF dx = Load(row + c + 1) - Load(row + c - 1);
      const VecF dy = Load(row + c + level.stride) - Load(row + c - level.stride);
      const VecF magnitude = Sqrt(dx * dx + dy * dy) * (Load(column_weights + c) * row_weight);
      const VecF position = Atan2(dy, dx) * (kOrientationBins / kTwoPi);
      const VecI bin = ToInt(position);
      const VecF upper = magnitude * (position - ToFloat(bin));
      Store(to_upper + c, upper);
      Store(to_lower + c, magnitude - upper);
      StoreInts(lower + c, bin);
    }
    const float squared_half = static_cast<float>(reach * reach) - distance * distance;
    const int half = squared_half > 1.0f ? static_cast<int>(__builtin_sqrtf(squared_half)) : 1;
    for (int c = kOrientationReachPx - half; c < kOrientationReachPx + half; ++c) {
      float* bin = histograms[c & 3] + lower[c];
      bin[0] += to_lower[c];
      bin[1] += to_upper[c];
    }
  }
  float* histogram = histograms[0];
  for (int i = 0; i < kOrientationBins + 2; ++i) {
    histogram[i] = (histograms[0][i] + histograms[1][i]) + (histograms[2][i] + histograms[3][i]);
  }
  histogram[0] += histogram[kOrientationBins];
  histogram[1] += histogram[kOrientationBins + 1];

  float smooth[kOrientationBins];
  float highest = 0.0f;
  for (int i = 0; i < kOrientationBins; ++i) {
    const auto at = [&](int k) { return histogram[(i + k + kOrientationBins) % kOrientationBins]; };
    smooth[i] = (at(-2) + at(2)) * (1.0f / 16) + (at(-1) + at(1)) * (4.0f / 16) + at(0) * (6.0f / 16);
    highest = smooth[i] > highest ? smooth[i] : highest;
  }
  float heights[kMaxOrientations];
  int count = 0;
  for (int i = 0; i < kOrientationBins; ++i) {
    const float before = smooth[(i + kOrientationBins - 1) % kOrientationBins];
    const float here = smooth[i];
    const float after = smooth[(i + 1) % kOrientationBins];
    if (here < kOrientationPeakRatio * highest || here <= before || here < after) continue;
    // Vertex of the parabola through the three.
    float position = static_cast<float>(i) + 0.5f * (before - after) / (before - 2.0f * here + after);
    if (position < 0.0f) position += kOrientationBins;
    float angle = position * (kTwoPi / kOrientationBins);
    if (angle >= kTwoPi) angle = 0.0f;
    int slot = count < kMaxOrientations ? count++ : kMaxOrientations;
    while (slot > 0 && heights[slot - 1] < here) {
      if (slot < kMaxOrientations) {
        heights[slot] = heights[slot - 1];
        angles[slot] = angles[slot - 1];
      }
      --slot;
    }
    if (slot < kMaxOrientations) {
      heights[slot] = here;
      angles[slot] = angle;
    }
  }
  return count;
}

typedef float Vec8F __attribute__((vector_size(32), may_alias));

inline void Quantise(const float* histogram, bool root_sift, std::uint8_t* descriptor) {
  float squares = 0.0f;
  for (int i = 0; i < 128; ++i) squares += histogram[i] * histogram[i];
  if (squares <= 1e-20f) {
    for (int i = 0; i < 128; ++i) descriptor[i] = 0;
    return;
  }
  float clipped[128];
  const float limit = kDescriptorClip * __builtin_sqrtf(squares);
  float clipped_squares = 0.0f;
  float clipped_sum = 0.0f;
  for (int i = 0; i < 128; ++i) {
    clipped[i] = histogram[i] < limit ? histogram[i] : limit;
    clipped_squares += clipped[i] * clipped[i];
    clipped_sum += clipped[i];
  }
  if (root_sift) {
    for (int i = 0; i < 128; ++i) clipped[i] = __builtin_sqrtf(clipped[i]);
  }
  const float factor = kDescriptorNorm / __builtin_sqrtf(root_sift ? clipped_sum : clipped_squares);
  for (int i = 0; i < 128; ++i) {
    const float scaled = clipped[i] * factor + 0.5f;
    descriptor[i] = static_cast<std::uint8_t>(scaled < 255.0f ? scaled : 255.0f);
  }
}

void Describe(const Plane& level, const PatchFrame& frame, bool root_sift, std::uint8_t* descriptor) {
  constexpr int kSide = DescriptorTables::kSide;
  const DescriptorTables& tables = GetDescriptorTables();
  alignas(64) float magnitudes[DescriptorTables::kPaddedSize];
  alignas(64) float bins[DescriptorTables::kPaddedSize];
  const float spacing = kDescriptorCellSize / kDescriptorSamplesPerCell * frame.scale;
  SampleGradients(level, tables, frame.x, frame.y, spacing * __builtin_cosf(frame.angle),
                  spacing * __builtin_sinf(frame.angle), magnitudes, bins);

  alignas(64) Vec8F cells[kDescriptorCells + 2][kDescriptorCells] = {};  // a row above and below for what falls outside
  const Vec8F orientations = {0, 1, 2, 3, 4, 5, 6, 7};
  for (int r = 0; r < kSide; ++r) {
    Vec8F row[kDescriptorCells + 2] = {};
#pragma GCC unroll 32
    for (int c = 0; c < kSide; ++c) {
      // Linear in the circular distance to each of the eight orientations.
      const Vec8F offset = orientations - bins[r * kSide + c];
      Vec8F distance = offset > 0.0f ? offset : -offset;
      distance = distance > 4.0f ? 8.0f - distance : distance;
      Vec8F weight = 1.0f - distance;
      weight = weight > 0.0f ? weight : Vec8F{};
      weight *= magnitudes[r * kSide + c];
      const int before = c / kDescriptorSamplesPerCell;
      row[before] += weight * tables.before_weight[c];
      row[before + 1] += weight * tables.after_weight[c];
    }
    const int before = r / kDescriptorSamplesPerCell;
    for (int b = 0; b < kDescriptorCells; ++b) {
      cells[before][b] += row[b + 1] * tables.before_weight[r];
      cells[before + 1][b] += row[b + 1] * tables.after_weight[r];
    }
  }
  Quantise(reinterpret_cast<const float*>(cells[1]), root_sift, descriptor);
}

constexpr SiftKernels kKernels = {UpsampleRows, ConvertRows,      BlurRows,   DecimateRows,
                                  FindExtrema,  FindOrientations, AlignPatch, Describe};

}  // namespace
}  // namespace haustra::kernels
