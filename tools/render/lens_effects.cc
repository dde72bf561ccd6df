#include "tools/render/lens_effects.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/rng.h"
#include "tools/render/soft_focus.h"

namespace haustra::render {

LensEffects::LensEffects(const std::vector<Event>& events, const WindowMask& window, std::uint64_t seed) {
  Rng rng(seed, 0x1e25);
  const auto draw = [&](double low, double high) { return static_cast<float>(rng.Uniform(low, high)); };
  for (const Event& event : events) {
    // In the scene, not on the lens; a slip leaves all other events as they are.
    if (!HidesScene(event.kind) || event.kind == EventKind::kSlip) continue;
    Active active{event, rng.Next(), {}};
    const bool is_foam = event.kind == EventKind::kBubbles;
    if (is_foam || event.kind == EventKind::kDebris) {
      const int count = static_cast<int>((is_foam ? 420 : 90) * std::max(event.duration_s, 0.5));
      for (int i = 0; i < count; ++i) {
        const double size = std::pow(rng.Uniform(), 2.2);
        Drop b{};
        b.x = draw(-0.05, 1.4);
        b.y = draw(-0.05, 1.05);
        b.radius = static_cast<float>(is_foam ? 0.012 + 0.085 * size : 0.004 + 0.03 * size);
        b.drift_x = draw(-0.35, 0.35);
        b.drift_y = draw(-0.55, 0.25);
        b.life_s = draw(0.25, 1.1);
        b.birth_s = draw(-0.5 * b.life_s, event.duration_s);
        active.drops.push_back(b);
      }
    }
    active_.push_back(std::move(active));
  }
  if (active_.empty()) return;
  // Each pixel of the surround takes the last one of the window on its way to the middle.
  const int width = window.mask().width, height = window.mask().height;
  const float cx = 0.5f * static_cast<float>(width - 1), cy = 0.5f * static_cast<float>(height - 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (window.coverage(x, y) > 0.0f) continue;
      for (float share = 0.99f; share > 0.0f; share -= 0.005f) {
        const int sx = static_cast<int>(std::lround(cx + share * (static_cast<float>(x) - cx)));
        const int sy = static_cast<int>(std::lround(cy + share * (static_cast<float>(y) - cy)));
        if (window.coverage(sx, sy) <= 0.0f) continue;
        surround_.push_back({y * width + x, sy * width + sx});
        break;
      }
    }
  }
}

void LensEffects::FillSurround(LinearImage* image) const {
  for (const Copy& copy : surround_) {
    for (int c = 0; c < 3; ++c) image->rgb[std::size_t(3) * copy.to + c] = image->rgb[std::size_t(3) * copy.from + c];
  }
}

bool LensEffects::IsActive(double time_s) const {
  return std::any_of(active_.begin(), active_.end(), [&](const Active& a) {
    return a.event.kind != EventKind::kBlur && a.event.kind != EventKind::kJump && a.event.Envelope(time_s) > 0.0;
  });
}

void LensEffects::Apply(double time_s, LinearImage* image) const {
  for (const Active& active : active_) {
    const auto alpha = static_cast<float>(active.event.Envelope(time_s));
    if (alpha <= 0.0f) continue;
    FillSurround(image);
    const LensMoment moment{active.seed, alpha, static_cast<float>(time_s - active.event.start_s), TypicalLevel(*image),
                            active.drops};
    switch (active.event.kind) {
      case EventKind::kRedout: DrawTissue(moment, image); break;
      case EventKind::kWater: DrawWater(moment, image); break;
      case EventKind::kBubbles: DrawFoam(moment, image); break;
      case EventKind::kDebris: DrawTurbidWater(moment, image); break;
      case EventKind::kBlur:
      case EventKind::kJump:
      case EventKind::kSlip:
      case EventKind::kNarrowBand:
      case EventKind::kInstrument: break;  // in the path, the shutter, the light and the scene
    }
  }
}

}  // namespace haustra::render
