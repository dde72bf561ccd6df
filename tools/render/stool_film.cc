#include "tools/render/stool_film.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/render/mucosa_painter.h"
#include "tools/render/smooth_step.h"

namespace haustra::render {
namespace {

constexpr float kPatchMm = 9.0f;
constexpr float kFilmEdge = 0.05f;  // of the rank: where the film runs out
constexpr std::array<float, 3> kStoolRgb = {0.37f, 0.165f, 0.034f};
// Optical depth of a film of usual thickness; blue is absorbed most.
constexpr std::array<float, 3> kFilmDepth = {0.8f, 1.0f, 1.7f};
constexpr int kCoarseCells = 60, kFineCells = 210, kLumpCells = 85;  // around the girth: 2.3, 0.66 and 1.6 mm

float AroundGirth(int texel, int cells) {
  return static_cast<float>(texel) * static_cast<float>(cells) / kMucosaColumns;
}

}  // namespace

StoolFilm::StoolFilm(double share, int rows, std::uint64_t seed)
    : share_(static_cast<float>(share)),
      order_(static_cast<std::uint32_t>(seed) * 31u + 0x5700u, rows, kPatchMm),
      coarse_(static_cast<std::uint32_t>(seed) + 0x5710u, kCoarseCells),
      fine_(static_cast<std::uint32_t>(seed) + 0x5711u, kFineCells),
      lumps_(static_cast<std::uint32_t>(seed) + 0x5712u, kLumpCells) {}

void StoolFilm::Cover(int row, int column, MucosaTexel* texel) const {
  const float rank = order_.Rank(row, column);
  if (rank >= share_) return;
  const float inside = SmoothStep(0.0f, std::min(kFilmEdge, 0.5f * share_), share_ - rank);
  const float coarse = coarse_.At(AroundGirth(row, kCoarseCells), AroundGirth(column, kCoarseCells));
  const float fine = fine_.At(AroundGirth(row, kFineCells), AroundGirth(column, kFineCells));
  const float depth_in = std::min((share_ - rank) * 2.5f, 0.8f);  // thicker towards the middle of a patch
  // Bent by the noise: lumps are not round.
  const CellNoise::Distances cell =
      lumps_.At(AroundGirth(row, kLumpCells) + 0.45f * fine, AroundGirth(column, kLumpCells) + 0.45f * coarse);
  const float lump = 1.0f - SmoothStep(0.06f, 0.36f, cell.nearest);
  // Lumps lie where the film is thick.
  const float lumps = lump * SmoothStep(0.1f, 0.45f, coarse + 0.5f * depth_in);
  const float thickness = inside * std::max(0.12f, 0.6f + depth_in + 0.7f * coarse + 0.35f * fine + 1.2f * lumps);
  const float tone = 1.0f + 0.22f * fine + 0.2f * coarse - 0.35f * lumps;
  for (int c = 0; c < 3; ++c) {
    const float through = std::exp(-kFilmDepth[c] * thickness);
    texel->rgb[c] = through * texel->rgb[c] + (1.0f - through) * tone * kStoolRgb[c];
  }
  texel->wetness += inside * (0.55f + 0.2f * coarse - texel->wetness);
  texel->height_mm += 0.03f * thickness + 0.018f * inside * lumps;
}

}  // namespace haustra::render
