#include "tools/render/mucosa_painter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/render/smooth_step.h"

namespace haustra::render {
namespace {

constexpr int kNetCells = 44;       // meshes of the capillary net of about 3 mm
constexpr int kFollicleCells = 13;  // pale lymph follicles, one every 10 mm or so
constexpr float kFollicleScale = static_cast<float>(kFollicleCells) / kMucosaColumns;
constexpr float kFollicleRadius = 0.085f;  // cells
constexpr float kBloodPatchMm = 13.0f;
constexpr int kCoarse = 8;  // texels between two samples of what varies slowly
constexpr int kCoarseColumns = kMucosaColumns / kCoarse;

int CellsAround(float wavelength_mm) { return std::max(1, static_cast<int>(kMucosaGirthMm / wavelength_mm)); }

}  // namespace

MucosaPainter::Octave::Octave(std::uint32_t seed, float wavelength_mm)
    : noise(seed, CellsAround(wavelength_mm)),
      cells_per_texel(static_cast<float>(CellsAround(wavelength_mm)) / kMucosaColumns) {}

MucosaPainter::MucosaPainter(const MucosaStyle& style, const LumenShape& shape, int rows, std::uint64_t seed)
    : style_(style),
      shape_(shape),
      arteries_(rows, kMucosaColumns, kMucosaTexelMm),
      veins_(rows, kMucosaColumns, kMucosaTexelMm),
      rng_(seed, 0x7ec5),
      blotch_(rng_.Next(), 34.0f),
      patch_(rng_.Next(), 11.0f),
      tint_(rng_.Next(), 19.0f),
      grain_{Octave(rng_.Next(), 3.1f), Octave(rng_.Next(), 1.35f), Octave(rng_.Next(), 0.62f),
             Octave(rng_.Next(), 0.3f)},
      relief_{Octave(rng_.Next(), 4.6f), Octave(rng_.Next(), 1.9f), Octave(rng_.Next(), 0.85f),
              Octave(rng_.Next(), 0.36f)},
      net_mask_(rng_.Next(), 9.0f),
      net_(rng_.Next(), kNetCells),
      follicles_(rng_.Next(), kFollicleCells) {
  DrawVessels(style_.arteries, rng_, &arteries_);
  DrawVessels(style_.veins, rng_, &veins_);
  if (style_.stool > 0.0) stool_.emplace(style_.stool, rows, seed);
  if (style_.blood.share > 0.0) blood_.emplace(static_cast<std::uint32_t>(seed) * 37u + 0xb100du, rows, kBloodPatchMm);
}

MucosaPainter::Slow MucosaPainter::SlowAt(int row, int column) const {
  return {blotch_.At(row, column),      patch_.At(row, column),    tint_.At(row, column),
          net_mask_.At(row, column),    grain_[0].At(row, column), relief_[0].At(row, column),
          FollicleDistance(row, column)};
}

float MucosaPainter::FollicleDistance(int row, int column) const {
  return follicles_.At(static_cast<float>(row) * kFollicleScale, static_cast<float>(column) * kFollicleScale).nearest;
}

void MucosaPainter::PaintRow(int row, double arc_mm, std::vector<MucosaTexel>* texels) const {
  std::array<Slow, kCoarseColumns + 1> slow;
  for (int i = 0; i < kCoarseColumns; ++i) slow[i] = SlowAt(row, i * kCoarse);
  slow[kCoarseColumns] = slow[0];
  texels->resize(kMucosaColumns);
  for (int column = 0; column < kMucosaColumns; ++column) {
    const Slow &before = slow[column / kCoarse], &after = slow[column / kCoarse + 1];
    const float share = static_cast<float>(column % kCoarse) / kCoarse;
    const auto between = [&](float Slow::*value) { return before.*value + share * (after.*value - before.*value); };
    Slow here{between(&Slow::blotch),
              between(&Slow::patch),
              between(&Slow::tint),
              between(&Slow::net_mask),
              between(&Slow::coarse_grain),
              between(&Slow::coarse_relief),
              1.0f};
    // A distance changes by no more than the way: far from follicles there is no need to ask again.
    if (before.from_follicle < kFollicleRadius + kCoarse * kFollicleScale) {
      here.from_follicle = FollicleDistance(row, column);
    }
    (*texels)[column] = At(row, column, arc_mm, here);
  }
}

MucosaTexel MucosaPainter::At(int row, int column, double arc_mm, const Slow& slow) const {
  const std::size_t index = std::size_t(row) * kMucosaColumns + column;
  const float artery = style_.vessels * static_cast<float>(arteries_.values[index]) / 255.0f;
  const float vein = style_.vessels * static_cast<float>(veins_.values[index]) / 255.0f;
  const float g0 = slow.coarse_grain, g1 = grain_[1].At(row, column), g2 = grain_[2].At(row, column),
              g3 = grain_[3].At(row, column);

  // Capillary net: borders of warped cells, here and there.
  const float net_scale = static_cast<float>(kNetCells) / kMucosaColumns;
  const CellNoise::Distances cell =
      net_.At(static_cast<float>(row) * net_scale + 0.45f * g0, static_cast<float>(column) * net_scale + 0.45f * g1);
  const float border = 1.0f - SmoothStep(0.015f, 0.08f, cell.second - cell.nearest);
  const float capillary = style_.vessels * border * SmoothStep(-0.25f, 0.45f, slow.net_mask) * 0.34f;
  const float follicle = 1.0f - SmoothStep(0.03f, kFollicleRadius, slow.from_follicle);

  const float angle = 2.0f * std::numbers::pi_v<float> * static_cast<float>(column) / kMucosaColumns;
  MucosaTexel out{};
  float polyp = 0.0f;
  if (arc_mm >= 0.0) polyp = static_cast<float>(shape_.PolypWeight(arc_mm, angle));

  const float brightness = 1.0f + style_.mottle * (0.14f * slow.blotch + 0.13f * slow.patch) +
                           style_.detail * (0.075f * g0 + 0.085f * g1 + 0.075f * g2 + 0.06f * g3) +
                           0.16f * style_.detail * follicle;
  const float hue = style_.mottle * (0.13f * slow.tint + 0.05f * g0);
  const float absorption = 0.85f * artery + capillary;
  // Blood lets red pass; veins look bluish because they lie deeper.
  out.rgb[0] = style_.base_rgb[0] * brightness * std::exp(-0.42f * absorption - 0.75f * vein);
  out.rgb[1] = style_.base_rgb[1] * brightness * (1.0f + hue) * std::exp(-1.25f * absorption - 0.95f * vein);
  out.rgb[2] = style_.base_rgb[2] * brightness * (1.0f + 0.7f * hue) * std::exp(-1.15f * absorption - 0.50f * vein);
  out.rgb[1] *= 1.0f - 0.30f * polyp;
  out.rgb[2] *= 1.0f - 0.25f * polyp;

  out.wetness = style_.wetness * Saturate(0.45f + 0.85f * slow.patch + 0.30f * g0);
  out.height_mm = style_.relief * (0.140f * slow.coarse_relief + 0.050f * relief_[1].At(row, column) +
                                   0.013f * relief_[2].At(row, column) + 0.0030f * relief_[3].At(row, column) +
                                   0.020f * artery + 0.009f * border + 0.04f * follicle);
  if (stool_) stool_->Cover(row, column, &out);
  if (blood_) out.blood_rank = blood_->Rank(row, column);
  return out;
}

}  // namespace haustra::render
