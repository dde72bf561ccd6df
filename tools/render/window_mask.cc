#include "tools/render/window_mask.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace haustra::render {
namespace {

// Shares of the image height.
constexpr double kBorder = 0.011;
constexpr double kCorner = 0.205;
constexpr double kRimPx = 1.5;

}  // namespace

WindowMask::WindowMask(int width_px, int height_px) : width_(width_px), height_(height_px) {
  const double border = std::max(1.0, kBorder * height_px), corner = kCorner * height_px;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const double from_side = std::min(x, width_px - 1 - x) - border;
      const double from_top = std::min(y, height_px - 1 - y) - border;
      const double from_corner = (from_side + from_top - corner) / std::numbers::sqrt2;
      const double inside = std::min({from_side, from_top, from_corner});
      coverage_.push_back(static_cast<float>(std::clamp(inside / kRimPx, 0.0, 1.0)));
      mask_.push_back(inside >= kRimPx ? 255 : 0);
    }
  }
}

}  // namespace haustra::render
