// From light to the picture that the processor hands out: optics (slight blur, vignetting), exposure, noise, tone
// curve, window. Immutable; reentrant.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "capture/image.h"
#include "tools/render/linear_image.h"
#include "tools/render/window_mask.h"

namespace haustra::render {

class Sensor {
 public:
  // Keeps a reference to the window. noise: gain on the usual noise.
  Sensor(const WindowMask& window, int width_px, int height_px, float noise, std::uint64_t seed);

  // picture: kBgr8. The noise depends on the seed and the frame's number alone. Uses `linear` as scratch.
  void Develop(float gain, int frame, LinearImage* linear, Image* picture) const;

 private:
  const WindowMask& window_;
  float noise_;
  std::uint32_t seed_;
  std::vector<float> vignette_;
  std::vector<std::uint8_t> tone_;  // displayed value by the square root of the exposure
};

}  // namespace haustra::render
