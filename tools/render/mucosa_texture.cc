#include "tools/render/mucosa_texture.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "tools/command/parallel_for.h"
#include "tools/render/smooth_step.h"

namespace haustra::render {
namespace {

constexpr int kColumns = kMucosaColumns;
constexpr float kTexelMm = kMucosaTexelMm;
constexpr float kMaxSlope = 0.7f;
constexpr int kMaxTaps = 4;
// Four channels in one register of any machine with SIMD.
using Vec4f = float __attribute__((vector_size(16)));
using Vec4u8 = std::uint8_t __attribute__((vector_size(4)));

// Reflectance is stored as its square root: eight bits then suffice in the dark.
std::uint8_t EncodeReflectance(float x) {
  return static_cast<std::uint8_t>(std::lround(255.0f * std::sqrt(Saturate(x))));
}
std::uint8_t EncodeSlope(float s) {
  return static_cast<std::uint8_t>(std::lround(128.0f + 127.0f * std::clamp(s / kMaxSlope, -1.0f, 1.0f)));
}

MucosaTexel Mix(const MucosaTexel& a, const MucosaTexel& b, float w) {
  MucosaTexel out{};
  for (int c = 0; c < 3; ++c) out.rgb[c] = a.rgb[c] + w * (b.rgb[c] - a.rgb[c]);
  out.wetness = a.wetness + w * (b.wetness - a.wetness);
  out.height_mm = a.height_mm + w * (b.height_mm - a.height_mm);
  out.blood_rank = a.blood_rank + w * (b.blood_rank - a.blood_rank);
  return out;
}

}  // namespace

MucosaTexture::MucosaTexture(const MucosaStyle& style, const Colon& colon, std::uint64_t seed, int num_threads)
    : pole_mm_(static_cast<float>(colon.mesh().surface_length_mm())),
      dome_mm_(static_cast<float>(colon.mesh().dome_reach_mm())),
      dome_centre_mm_(pole_mm_ + dome_mm_ + 2.0f) {
  const int tube_rows = static_cast<int>(std::ceil(pole_mm_ / kTexelMm)) + 2;
  const int rows = static_cast<int>(std::ceil((dome_centre_mm_ + dome_mm_) / kTexelMm)) + 2;
  const ColonMesh& mesh = colon.mesh();
  const TwinSegment& twin = colon.style().twin;
  const MucosaPainter painter(style, colon.lumen(), rows, seed);
  Level base;
  base.rows = rows;
  base.columns = kColumns;
  base.texels.resize(std::size_t(rows) * kColumns * kChannels);
  std::vector<float> height(std::size_t(rows) * kColumns);

  ParallelFor(rows, num_threads, [&](int row, int) {
    const double arc_mm = row < tube_rows ? mesh.ArcAtSurface(row * kTexelMm) : -1.0;
    const auto weight = static_cast<float>(twin.Weight(arc_mm));
    const double twin_arc_mm = arc_mm - twin.offset_mm;
    const int twin_row = weight > 0.0f ? static_cast<int>(std::lround(mesh.SurfaceAtArc(twin_arc_mm) / kTexelMm)) : 0;
    std::vector<MucosaTexel> texels, twins;
    painter.PaintRow(weight < 1.0f ? row : twin_row, weight < 1.0f ? arc_mm : twin_arc_mm, &texels);
    if (weight > 0.0f && weight < 1.0f) painter.PaintRow(twin_row, twin_arc_mm, &twins);
    for (int column = 0; column < kColumns; ++column) {
      const MucosaTexel texel = twins.empty() ? texels[column] : Mix(texels[column], twins[column], weight);
      const std::size_t index = std::size_t(row) * kColumns + column;
      std::uint8_t* out = &base.texels[index * kChannels];
      for (int c = 0; c < 3; ++c) out[c] = EncodeReflectance(texel.rgb[c]);
      out[3] = static_cast<std::uint8_t>(std::lround(255.0f * Saturate(texel.wetness)));
      out[6] = static_cast<std::uint8_t>(std::lround(255.0f * Saturate(texel.blood_rank)));
      height[index] = texel.height_mm;
    }
  });
  ParallelFor(rows, num_threads, [&](int row, int) {
    const float* before = &height[std::size_t(std::max(row - 1, 0)) * kColumns];
    const float* after = &height[std::size_t(std::min(row + 1, rows - 1)) * kColumns];
    const float* here = &height[std::size_t(row) * kColumns];
    for (int column = 0; column < kColumns; ++column) {
      std::uint8_t* out = &base.texels[(std::size_t(row) * kColumns + column) * kChannels];
      const int right = (column + 1) & (kColumns - 1), left = (column - 1) & (kColumns - 1);
      out[4] = EncodeSlope((after[column] - before[column]) / (2.0f * kTexelMm));
      out[5] = EncodeSlope((here[right] - here[left]) / (2.0f * kTexelMm));
    }
  });
  levels_.push_back(std::move(base));
  AddCoarserLevels();
}

void MucosaTexture::AddCoarserLevels() {
  while (levels_.back().columns > 32) {
    const Level& fine = levels_.back();
    Level coarse;
    coarse.rows = std::max(1, fine.rows / 2);
    coarse.columns = fine.columns / 2;
    coarse.texels.resize(std::size_t(coarse.rows) * coarse.columns * kChannels);
    for (int r = 0; r < coarse.rows; ++r) {
      const std::uint8_t* top = &fine.texels[std::size_t(2 * r) * fine.columns * kChannels];
      const std::uint8_t* bottom =
          &fine.texels[std::size_t(std::min(2 * r + 1, fine.rows - 1)) * fine.columns * kChannels];
      std::uint8_t* out = &coarse.texels[std::size_t(r) * coarse.columns * kChannels];
      for (int c = 0; c < coarse.columns; ++c) {
        for (int k = 0; k < kChannels; ++k) {
          const int a = 2 * c * kChannels + k, b = a + kChannels;
          out[c * kChannels + k] = static_cast<std::uint8_t>((top[a] + top[b] + bottom[a] + bottom[b] + 2) / 4);
        }
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

MucosaSample MucosaTexture::Sample(const Footprint& f) const {
  const float from_pole = pole_mm_ - f.u_mm;
  const float dome = 1.0f - SmoothStep(0.55f, 0.85f, from_pole / dome_mm_);
  if (dome <= 0.0f) return SampleFlat(f);

  const float angle = f.v_mm * (2.0f * std::numbers::pi_v<float> / kGirthMm);
  const float cosine = std::cos(angle), sine = std::sin(angle);
  // In the plane through the pole: u runs inwards along a meridian, v along the parallel, in mm of the wall.
  const float squeeze = std::sin(0.5f * std::numbers::pi_v<float> * std::min(from_pole / dome_mm_, 1.0f));
  const float along = f.major_mm * f.major_u, around = f.major_mm * f.major_v * std::max(squeeze, 0.02f);
  Footprint flat = f;
  flat.u_mm = dome_centre_mm_ + from_pole * cosine;
  flat.v_mm = 0.5f * kGirthMm + from_pole * sine;
  const float major_u = -along * cosine - around * sine, major_v = -along * sine + around * cosine;
  flat.major_mm = std::max(std::sqrt(major_u * major_u + major_v * major_v), 1e-6f);
  flat.major_u = major_u / flat.major_mm;
  flat.major_v = major_v / flat.major_mm;
  MucosaSample out = SampleFlat(flat);
  const float slope_u = out.slope_u, slope_v = out.slope_v;
  out.slope_u = -slope_u * cosine - slope_v * sine;
  // The caller stretches slopes around the girth as it does the texture of the tube.
  out.slope_v = (-slope_u * sine + slope_v * cosine) * squeeze;
  if (dome >= 1.0f) return out;
  const MucosaSample tube = SampleFlat(f);
  const auto mix = [dome](float a, float b) { return a + dome * (b - a); };
  for (int c = 0; c < 3; ++c) out.rgb[c] = mix(tube.rgb[c], out.rgb[c]);
  out.wetness = mix(tube.wetness, out.wetness);
  out.slope_u = mix(tube.slope_u, out.slope_u);
  out.slope_v = mix(tube.slope_v, out.slope_v);
  out.blood_rank = mix(tube.blood_rank, out.blood_rank);
  return out;
}

MucosaSample MucosaTexture::SampleFlat(const Footprint& f) const {
  const float ratio = f.major_mm / std::max(f.minor_mm, 1e-6f);
  const int num_taps = static_cast<int>(std::lround(std::clamp(ratio, 1.0f, static_cast<float>(kMaxTaps))));
  // Width that one tap must cover; a little less than the spacing keeps the picture crisp.
  const float width_texels = std::max(f.minor_mm, f.major_mm / static_cast<float>(num_taps)) * (0.9f / kTexelMm);
  const float lod =
      std::clamp(std::log2(std::max(width_texels, 1.0f)), 0.0f, static_cast<float>(levels_.size()) - 1.01f);
  const int first_level = static_cast<int>(lod);
  const float level_weight[2] = {1.0f - (lod - static_cast<float>(first_level)), lod - static_cast<float>(first_level)};

  Vec4f sum[2] = {};
  for (int tap = 0; tap < num_taps; ++tap) {
    const float along = (static_cast<float>(tap) + 0.5f) / static_cast<float>(num_taps) - 0.5f;
    const float u = (f.u_mm + along * f.major_mm * f.major_u) * (1.0f / kTexelMm);
    const float v = (f.v_mm + along * f.major_mm * f.major_v) * (1.0f / kTexelMm);
    for (int k = 0; k < 2; ++k) {
      if (level_weight[k] <= 0.0f) continue;
      const Level& level = levels_[first_level + k];
      const float scale = 1.0f / static_cast<float>(1 << (first_level + k));
      // Centres of coarse texels lie between those of the finer ones.
      const float x = std::clamp((u + 0.5f) * scale - 0.5f, 0.0f, static_cast<float>(level.rows) - 1.001f);
      const float y = (v + 0.5f) * scale - 0.5f;
      const float fx = std::floor(x), fy = std::floor(y);
      const int row = static_cast<int>(fx);
      const int next_row = std::min(row + 1, level.rows - 1);
      const int mask = level.columns - 1;
      const int column = static_cast<int>(fy) & mask, next_column = (column + 1) & mask;
      const float tx = x - fx, ty = y - fy;
      const float weight_00 = level_weight[k] * (1.0f - tx) * (1.0f - ty),
                  weight_01 = level_weight[k] * (1.0f - tx) * ty;
      const float weight_10 = level_weight[k] * tx * (1.0f - ty), weight_11 = level_weight[k] * tx * ty;
      const auto add = [&](int r, int c, float weight) {
        const std::uint8_t* texel = &level.texels[(std::size_t(r) * level.columns + c) * kChannels];
        Vec4u8 low, high;
        std::memcpy(&low, texel, sizeof(low));
        std::memcpy(&high, texel + 4, sizeof(high));
        sum[0] += __builtin_convertvector(low, Vec4f) * weight;
        sum[1] += __builtin_convertvector(high, Vec4f) * weight;
      };
      add(row, column, weight_00);
      add(row, next_column, weight_01);
      add(next_row, column, weight_10);
      add(next_row, next_column, weight_11);
    }
  }
  const float norm = 1.0f / static_cast<float>(num_taps);
  MucosaSample out;
  for (int c = 0; c < 3; ++c) {
    const float root = sum[0][c] * norm * (1.0f / 255.0f);
    out.rgb[c] = root * root;
  }
  out.wetness = sum[0][3] * norm * (1.0f / 255.0f);
  out.slope_u = (sum[1][0] * norm - 128.0f) * (kMaxSlope / 127.0f);
  out.slope_v = (sum[1][1] * norm - 128.0f) * (kMaxSlope / 127.0f);
  out.blood_rank = sum[1][2] * norm * (1.0f / 255.0f);
  return out;
}

}  // namespace haustra::render
