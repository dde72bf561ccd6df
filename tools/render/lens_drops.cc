#include "tools/render/lens_drops.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "engine/geometry/rng.h"
#include "tools/render/out_of_range.h"
#include "tools/render/smooth_step.h"
#include "tools/render/soft_focus.h"

namespace haustra::render {
namespace {

constexpr double kComeAndGoS = 0.4;
// In its middle a drop shows the picture larger by 1 / (1 - kPower).
constexpr float kPower = 0.55f;
// A drop is far out of focus: what is seen through it is an average over this share of the picture's height.
constexpr float kDefocus = 0.014f;
constexpr int kTaps = 12;
// At the outline a drop is steep: its edge is dark on one side and bright on the other.
constexpr float kEdgeShade = 0.3f;

}  // namespace

Status LensDropsStyle::Validate() const {
  if (count < 0 || count > 40) return OutOfRange("lens drops", count, "[0, 40]");
  if (!(size_percent >= 2.0 && size_percent <= 40.0)) {
    return OutOfRange("lens drops: size", size_percent, "[2, 40] % of the picture's height");
  }
  return Status::Ok();
}

float LensDrop::Share(float px, float py) const {
  const float dx = px - x, dy = py - y;
  const float angle = std::atan2(dy, dx);
  const float outline =
      1.0f + 0.12f * std::cos(2.0f * angle + lobe_phase[0]) + 0.06f * std::cos(3.0f * angle + lobe_phase[1]);
  return std::sqrt(dx * dx + dy * dy) / (radius * outline);
}

LensDrops::LensDrops(const LensDropsStyle& style, const WindowMask& window, std::uint64_t seed)
    : style_(style), window_(window), seed_(seed) {}

LensDrop LensDrops::At(int i, double time_s) const {
  Rng place(seed_, 0xd2095 + static_cast<std::uint64_t>(i));
  const double stay_s = place.Uniform(style_.min_stay_s, style_.max_stay_s);
  const double shifted_s = time_s + place.Uniform(0.0, stay_s);
  const double turn = std::floor(shifted_s / stay_s);
  const double since_s = shifted_s - turn * stay_s;

  Rng rng(seed_ + static_cast<std::uint64_t>(static_cast<std::int64_t>(turn)) * 1000003u,
          0xd2095 + static_cast<std::uint64_t>(i));
  const int width = window_.mask().width, height = window_.mask().height;
  LensDrop drop;
  // Many small ones, few large ones; the mean is that of the style.
  const double u = rng.Uniform();
  drop.radius = static_cast<float>(0.005 * style_.size_percent * (0.6 + 1.2 * u * u));
  do {
    drop.x = static_cast<float>(rng.Uniform(0.0, width) / height);
    drop.y = static_cast<float>(rng.Uniform());
  } while (window_.coverage(static_cast<int>(drop.x * static_cast<float>(height)),
                            static_cast<int>(drop.y * static_cast<float>(height))) <= 0.0f);
  for (float& phase : drop.lobe_phase) phase = static_cast<float>(rng.Uniform(0.0, 2.0 * std::numbers::pi));
  const double speed = 0.01 * style_.creep_percent_per_s * rng.Uniform(0.3, 1.0);
  const double heading = rng.Uniform(-0.5, 0.5);  // from straight down
  drop.x += static_cast<float>(speed * since_s * std::sin(heading));
  drop.y += static_cast<float>(speed * since_s * std::cos(heading));
  drop.amount = static_cast<float>(SmoothStep(0.0f, 1.0f, static_cast<float>(since_s / kComeAndGoS)) *
                                   SmoothStep(0.0f, 1.0f, static_cast<float>((stay_s - since_s) / kComeAndGoS)));
  return drop;
}

void LensDrops::Apply(double time_s, LinearImage* image) const {
  for (int i = 0; i < style_.count; ++i) {
    const LensDrop drop = At(i, time_s);
    if (drop.amount <= 0.0f) continue;
    const LinearImage before = *image;
    Draw(drop, before, image);
  }
}

void LensDrops::Draw(const LensDrop& drop, const LinearImage& before, LinearImage* image) const {
  const auto height = static_cast<float>(image->height);
  const int x0 = std::max(0, static_cast<int>((drop.x - drop.reach()) * height));
  const int x1 = std::min(image->width - 1, static_cast<int>((drop.x + drop.reach()) * height) + 1);
  const int y0 = std::max(0, static_cast<int>((drop.y - drop.reach()) * height));
  const int y1 = std::min(image->height - 1, static_cast<int>((drop.y + drop.reach()) * height) + 1);
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      if (window_.coverage(x, y) <= 0.0f) continue;
      const float u = static_cast<float>(x) / height, v = static_cast<float>(y) / height;
      const float share = drop.Share(u, v);
      if (share >= 1.0f) continue;
      const float thickness = drop.amount * (1.0f - share * share);
      const float towards = 1.0f - kPower * thickness;
      const float sx = (drop.x + towards * (u - drop.x)) * height, sy = (drop.y + towards * (v - drop.y)) * height;
      // Even over a disc (a sunflower's seeds), so that light is neither lost nor won.
      const float defocus = kDefocus * height * SmoothStep(0.0f, 0.35f, thickness);
      float sum[3] = {0.0f, 0.0f, 0.0f};
      int count = 0;
      for (int k = 0; k < kTaps; ++k) {
        const float distance = defocus * std::sqrt((static_cast<float>(k) + 0.5f) / kTaps);
        const float angle = 2.3999632f * static_cast<float>(k);
        const float tx = sx + distance * std::cos(angle), ty = sy + distance * std::sin(angle);
        const int px = static_cast<int>(std::lround(tx)), py = static_cast<int>(std::lround(ty));
        if (px < 0 || py < 0 || px >= image->width || py >= image->height) continue;
        if (window_.coverage(px, py) <= 0.0f) continue;
        float rgb[3];
        SampleBilinear(before, tx, ty, rgb);
        for (int c = 0; c < 3; ++c) sum[c] += rgb[c];
        ++count;
      }
      if (count == 0) continue;
      const float edge = drop.amount * SmoothStep(0.72f, 0.95f, share) * (1.0f - SmoothStep(0.95f, 1.0f, share));
      const float shade = 1.0f + kEdgeShade * edge * (v - drop.y) / drop.radius;
      for (int c = 0; c < 3; ++c) image->pixel(x, y)[c] = shade * sum[c] / static_cast<float>(count);
    }
  }
}

}  // namespace haustra::render
