// Automatic exposure with a lag, as endoscopy processors do it: the gain follows the brightness of past pictures.
// thread-bound(its owner).
#pragma once

#include <array>

#include "tools/render/linear_image.h"
#include "tools/render/window_mask.h"

namespace haustra::render {

// How the brightness of a picture is spread, in steps of a quarter of a doubling.
struct Metering {
  static constexpr int kBins = 96;
  static constexpr float kLowest = 1.0f / 16384.0f;
  std::array<int, kBins> count{};
};
Metering Meter(const LinearImage& image, const WindowMask& window);

// Displayed brightness (0 to 1, gamma encoded) of linear light times gain: a soft shoulder, then gamma 2.2.
float ToneCurve(float exposed);

class AutoExposure {
 public:
  // Gain for the next picture; starts from the first metering at its steady state.
  float gain() const { return gain_; }
  void Start(const Metering& first);
  // What the picture taken with gain() looked like.
  void Update(const Metering& metering, double interval_s);

 private:
  static float MeanBrightness(const Metering& metering, float gain);

  float gain_ = 1.0f;
};

}  // namespace haustra::render
