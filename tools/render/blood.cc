#include "tools/render/blood.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/render/smooth_step.h"

namespace haustra::render {
namespace {

// Ranks over which a film becomes thick, and over which its edge is drawn.
constexpr float kBloodThick = 0.12f, kBloodEdge = 0.04f;
// Haemoglobin lets red pass and little else (law of Beer and Lambert); optical depth of the thickest film.
constexpr std::array<float, 3> kBloodDepth = {1.25f, 4.6f, 4.2f};
// What a thick layer scatters back.
constexpr std::array<float, 3> kBloodRgb = {0.115f, 0.0042f, 0.0036f};
constexpr float kBloodWetness = 0.8f;

}  // namespace

void CoverWithBlood(float share, MucosaSample* sample) {
  const float beyond_edge = share - sample->blood_rank;
  if (share <= 0.0f || beyond_edge <= 0.0f) return;
  const float inside = SmoothStep(0.0f, std::min(kBloodEdge, share), beyond_edge);
  const float thickness = inside * (0.4f + 0.6f * SmoothStep(0.0f, kBloodThick, beyond_edge));
  for (int c = 0; c < 3; ++c) {
    const float through = std::exp(-kBloodDepth[c] * thickness);
    sample->rgb[c] = through * sample->rgb[c] + (1.0f - through) * kBloodRgb[c];
  }
  sample->wetness += inside * (kBloodWetness - sample->wetness);
  // It fills the relief.
  const float relief = 1.0f - 0.55f * thickness;
  sample->slope_u *= relief;
  sample->slope_v *= relief;
}

}  // namespace haustra::render
