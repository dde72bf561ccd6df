// The octagonal window through which an endoscopy processor shows the picture. Immutable; reentrant.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/core/views.h"

namespace haustra::render {

class WindowMask {
 public:
  WindowMask(int width_px, int height_px);

  // 1 inside, 0 outside, between at the soft rim.
  float coverage(int x, int y) const { return coverage_[std::size_t(y) * width_ + x]; }
  // 255 where the picture is whole, 0 elsewhere. Lives as long as this object.
  ImageView mask() const { return {mask_.data(), width_, height_, width_, PixelFormat::kGrey8}; }

 private:
  int width_, height_;
  std::vector<float> coverage_;
  std::vector<std::uint8_t> mask_;
};

}  // namespace haustra::render
