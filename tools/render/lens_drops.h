// Drops of fluid that stay on the lens. Each one bends and blurs a part of the picture for many seconds while it creeps
// down; then it is washed off and another one lies elsewhere. The scene is seen beside them and through them.
// Works on linear light, before exposure. A pure function of time. Immutable; reentrant.
#pragma once

#include <array>
#include <cstdint>

#include "hal/core/status.h"
#include "tools/render/linear_image.h"
#include "tools/render/window_mask.h"

namespace haustra::render {

struct LensDropsStyle {
  int count = 0;               // at any time; [0, 40]
  double size_percent = 12.0;  // mean diameter, % of the picture's height; [2, 40]
  // A drop lies there for so long: between these, seconds.
  double min_stay_s = 14.0, max_stay_s = 30.0;
  double creep_percent_per_s = 0.35;  // at most, of the picture's height

  // kInvalidArgument names what is out of range.
  Status Validate() const;
};

// One drop at one time. Lengths are shares of the picture's height.
struct LensDrop {
  float x = 0.0f, y = 0.0f, radius = 0.0f;
  float amount = 0.0f;                // 1 while it lies there, less as it comes and goes
  std::array<float, 2> lobe_phase{};  // radians: its outline is not a circle

  // Of a point: 0 in the middle, 1 on the outline.
  float Share(float px, float py) const;
  // Beyond this distance from the middle the picture is as it was.
  float reach() const { return 1.2f * radius; }
};

class LensDrops {
 public:
  // Keeps a reference to the window.
  LensDrops(const LensDropsStyle& style, const WindowMask& window, std::uint64_t seed);

  bool is_active() const { return style_.count > 0; }
  // The i-th of style.count drops.
  LensDrop At(int i, double time_s) const;
  void Apply(double time_s, LinearImage* image) const;

 private:
  void Draw(const LensDrop& drop, const LinearImage& before, LinearImage* image) const;

  LensDropsStyle style_;
  const WindowMask& window_;
  std::uint64_t seed_;
};

}  // namespace haustra::render
